//! The closed form against very many rays, on every scene.

use ao4d::accel::Tracer;
use ao4d::progress::Silent;
use ao4d::trace::cpu::PacketTracer;
use ao4d::trace::{Sampling, ShadingPoint};

use super::scenes;

in_3d_and_4d! { agrees_with_rays }

fn agrees_with_rays<const D: usize>() {
    let sampling = Sampling::new(1 << 14, 3);
    for scene in scenes::all::<D>(25) {
        let tracer = Tracer::new(scene.mesh.clone());
        let exact = scene.exact(&tracer);
        let mut packets = PacketTracer::default();
        let (mut worst, mut square) = (0.0f64, 0.0);
        for (&vertex, exact) in scene.vertices.iter().zip(&exact) {
            let point = ShadingPoint::Vertex(vertex);
            let sampled = f64::from(packets.estimate(&tracer, &point, &sampling, &Silent).unwrap().value);
            // Four standard errors of independent rays, which Sobol' points stay well below.
            let allowed = 4.0 * (exact * (1.0 - exact) / f64::from(sampling.samples)).sqrt() + 1e-4;
            assert!((sampled - exact).abs() < allowed, "{} vertex {vertex}: {sampled} {exact}", scene.name);
            worst = worst.max((sampled - exact).abs());
            square += (sampled - exact).powi(2);
        }
        let dark = exact.iter().filter(|&&a| a < 0.999).count();
        assert!(dark * 4 >= exact.len(), "{}: {dark} of {} vertices see anything", scene.name, exact.len());
        let rms = (square / exact.len() as f64).sqrt();
        println!("{}, {} of {} vertices dark: RMS {rms:.1e}, at most {worst:.1e}", scene.name, dark, exact.len());
        assert!(rms < 1.5e-3, "{}: {rms}", scene.name);
    }
}
