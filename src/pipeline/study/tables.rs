//! A study as text: `study.csv` for programs, `study.md` for people.

use std::fmt::Write;

use super::{Errors, Study, counted};
use crate::stages::describe::grouped;
use crate::stages::write::PROGRAM;
use crate::text::for_markdown;

/// One row a measurement. Occlusion: seconds are those of one vertex on one thread. Image: those of the whole image, values
/// and all, on all threads.
pub(super) fn csv(study: &Study) -> String {
    let mut text = String::from("kind,method,samples,repetitions,rmse,maximum,bias,seconds,rays_per_second\n");
    if let Some(seconds) = study.truth.seconds {
        let _ = writeln!(text, "occlusion,exact,0,1,0,0,0,{seconds:.4e},");
    }
    let mut row = |kind: &str, method: &str, samples: u32, repetitions: usize, e: &Errors, seconds: f64, rate: &str| {
        let Errors { rms, maximum, bias } = e;
        let _ = writeln!(
            text,
            "{kind},{method},{samples},{repetitions},{rms:.6e},{maximum:.6e},{bias:.6e},{seconds:.4e},{rate}"
        );
    };
    for r in &study.levels {
        let rate = format!("{:.4e}", r.rays_per_second);
        row("occlusion", r.method, r.samples, r.repetitions, &r.errors, r.seconds, &rate);
    }
    for r in study.pictures.iter().flat_map(|p| &p.rows) {
        row("image", r.shading, r.samples, 1, &r.errors, r.seconds, "");
    }
    text
}

/// Seconds with a unit.
pub(super) fn duration(seconds: f64) -> String {
    let (value, unit) = match seconds {
        s if s < 1e-3 => (s * 1e6, "µs"),
        s if s < 1.0 => (s * 1e3, "ms"),
        s => (s, "s"),
    };
    let digits = if value < 10.0 { 2 } else { usize::from(value < 100.0) };
    format!("{value:.digits$} {unit}")
}

/// The report.
pub(super) fn markdown(study: &Study) -> String {
    let mut text = String::new();
    let mut line = |arguments: std::fmt::Arguments| {
        let _ = writeln!(text, "{arguments}");
    };
    let looked_at = study.truth.values.len();
    let rest = if looked_at < study.vertices { format!(", of which {looked_at} are looked at") } else { String::new() };
    line(format_args!("# Error against time: {}\n", for_markdown(&study.name)));
    line(format_args!(
        "{}D, {}{rest}, {}. Seed {}, {}, {PROGRAM}.",
        study.dimension,
        counted(study.vertices, "vertices"),
        counted(study.simplices, "simplices"),
        study.seed,
        if study.threads == 1 { "1 thread".to_owned() } else { format!("{} threads", study.threads) }
    ));
    for note in &study.notes {
        line(format_args!("{note}"));
    }
    line(format_args!("\n![Error against rays and time](study.svg)\n"));
    line(format_args!("## Ambient occlusion at vertices\n"));
    let exact = study.truth.seconds.map(|s| format!(" `exact` takes {} a vertex on one thread.", duration(s)));
    let long = match study.truth.long_runs {
        0 => String::new(),
        n => format!(
            " For {n} vertices it is too expensive; there the truth is a long run, whose standard error is at most {:.1e}.",
            study.truth.error
        ),
    };
    line(format_args!(
        "Against `exact`, over all vertices looked at and as many seeds as trace half a million rays; time is that of one \
         vertex on one thread.{}{long}\n",
        exact.unwrap_or_default()
    ));
    line(format_args!("| method | rays | RMS error | largest | bias | time | rays a second |"));
    line(format_args!("| --- | ---: | ---: | ---: | ---: | ---: | ---: |"));
    for r in &study.levels {
        let Errors { rms, maximum, bias } = r.errors;
        line(format_args!(
            "| {} | {} | {rms:.5} | {maximum:.4} | {bias:+.5} | {} | {:.2} million |",
            r.method,
            grouped(u64::from(r.samples)),
            duration(r.seconds),
            r.rays_per_second / 1e6
        ));
    }
    if let Some(pictures) = &study.pictures {
        let [x, y, z] = pictures.dimensions;
        line(format_args!("\n## Shading\n"));
        line(format_args!(
            "The image `{}` with {x} x {y} x {z} voxels, {} of which see something, against {}. `flat` and `smooth` take rays \
             at vertices, `voxel` at each voxel, `auto` at vertices and first a sixteenth of them, 4 to 16, at each voxel, then as many as keep to an error of 0.01; `screen_space` takes none, and looks into so many slices of the image; time is \
             that of the whole image on all threads.\n",
            pictures.render,
            grouped(pictures.seen as u64),
            pictures.reference
        ));
        line(format_args!("| shading | rays or slices | RMS error | largest | bias | time |"));
        line(format_args!("| --- | ---: | ---: | ---: | ---: | ---: |"));
        for r in &pictures.rows {
            let Errors { rms, maximum, bias } = r.errors;
            line(format_args!(
                "| {} | {} | {rms:.4} | {maximum:.3} | {bias:+.4} | {} |",
                r.shading,
                r.samples,
                duration(r.seconds)
            ));
        }
    }
    line(format_args!("\n## The published algorithm, deviation by deviation\n"));
    line(format_args!("Occlusion, 1 - A, of 1024 rays a vertex, with one thing mended at a time (Djami 2021).\n"));
    line(format_args!("| variant | least | mean | largest | RMS error |"));
    line(format_args!("| --- | ---: | ---: | ---: | ---: |"));
    let truth = &study.truth.values;
    let (low, high) = truth.iter().fold((1.0f64, 0.0f64), |(low, high), &a| (low.min(1.0 - a), high.max(1.0 - a)));
    let mean = 1.0 - truth.iter().sum::<f64>() / looked_at.max(1) as f64;
    for s in &study.deviations {
        line(format_args!("| {} | {:.3} | {:.3} | {:.3} | {:.4} |", s.what, s.least, s.mean, s.most, s.errors.rms));
    }
    line(format_args!("| exact | {low:.3} | {mean:.3} | {high:.3} | |"));
    line(format_args!("\n## Plain Cramer's rule against exact signs\n"));
    line(format_args!(
        "Rays from all around, {} of each kind: on how many of them rounding finds a hit where there is none, or none where \
         there is one.\n",
        grouped(super::precision::RAYS as u64)
    ));
    line(format_args!("| aimed | rays that hit | wrong in f32 | wrong in f64 |"));
    line(format_args!("| --- | ---: | ---: | ---: |"));
    for d in &study.differing {
        line(format_args!(
            "| {} | {} | {} | {} |",
            d.aim,
            grouped(d.hit as u64),
            grouped(d.single as u64),
            grouped(d.double as u64)
        ));
    }
    text
}

#[cfg(test)]
mod tests {
    #[test]
    fn durations_have_three_digits() {
        for (seconds, text) in [(1.234e-6, "1.23 µs"), (4.56e-5, "45.6 µs"), (0.123, "123 ms"), (2.0, "2.00 s")] {
            assert_eq!(super::duration(seconds), text);
        }
    }
}
