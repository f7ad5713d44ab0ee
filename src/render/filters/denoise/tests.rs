use super::*;
use crate::geometry::Vector;
use crate::occlusion::Error;
use crate::progress::Silent;
use crate::render::gbuffer::GBuffer;
use crate::render::{Projection, View};

/// Numbers from 0 to 1, evenly spread, the same each time.
fn noise(n: usize) -> f64 {
    let mut x = (n as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    x = (x ^ (x >> 31)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    (x >> 11) as f64 / (1u64 << 53) as f64
}

/// About as much noise as 16 rays have, uniform.
const AMPLITUDE: f64 = 0.12;

/// A flat wall across the line of sight that fills the image, of occlusion `truth` and so much noise on it; and the
/// filters. Objects are told by `object`.
fn wall(
    truth: impl Fn([usize; 3]) -> f64,
    object: impl Fn([usize; 3]) -> u16,
    amplitude: f64,
) -> (GBuffer<4>, [Box<dyn ImageFilter<4>>; 2]) {
    let view = View { projection: Projection::Parallel { height: 2.0 }, ..View::<4>::default() };
    let camera = Camera::new(&view).unwrap();
    let grid = camera.grid([20, 20, 20]);
    let mut buffer = GBuffer::new(grid.dimensions, 0..20, COLUMNS);
    for n in 0..buffer.len() {
        let index = grid.index(n);
        let [x, y, z] = grid.point(index).map(|c| c as f32);
        buffer.simplex[n] = 0;
        buffer.object[n] = object(index);
        buffer.position[n] = Vector::from([x, y, z, 0.0]);
        buffer.normal[n] = Vector::from([0.0, 0.0, 0.0, 1.0]);
        buffer.occlusion[n] = (truth(index) + amplitude * (2.0 * noise(n) - 1.0)) as f32;
    }
    (buffer, denoise(&camera, &grid, Sampling::new(16, 1)))
}

fn filtered(buffer: &GBuffer<4>, filters: &[Box<dyn ImageFilter<4>>; 2]) -> GBuffer<4> {
    filters.iter().fold(buffer.clone(), |buffer, filter| {
        let mut out = buffer.clone();
        filter.apply(&buffer, &mut out, &Silent).unwrap();
        out
    })
}

/// The RMS of what a picture is off, the RMS of what it says, and the mean of what it is off.
fn errors(out: &GBuffer<4>, truth: impl Fn([usize; 3]) -> f64) -> (f64, f64, f64) {
    let (mut squares, mut said, mut sum) = (0.0, 0.0, 0.0);
    for n in 0..out.len() {
        let error = f64::from(out.occlusion[n]) - truth([n % 20, n / 20 % 20, n / 400]);
        squares += error * error;
        said += f64::from(out.error[n]).powi(2);
        sum += error;
    }
    let count = out.len() as f64;
    ((squares / count).sqrt(), (said / count).sqrt(), sum / count)
}

#[test]
fn noise_on_a_gradient_goes_and_the_gradient_stays() {
    let truth = |[i, j, k]: [usize; 3]| 0.3 + 0.01 * i as f64 + 0.005 * j as f64 + 0.004 * k as f64;
    let (buffer, filters) = wall(truth, |_| 1, AMPLITUDE);
    let (before, ..) = errors(&buffer, truth);
    let (real, said, bias) = errors(&filtered(&buffer, &filters), truth);
    assert!(before > 0.06 && real < 0.008, "{before} {real}: some 340 neighbours, fewer at the image's border");
    assert!((0.8..1.25).contains(&(said / real)), "said {said}, real {real}");
    assert!(bias.abs() < 5e-4, "biased by {bias}");
}

#[test]
fn what_all_agree_about_stays_to_the_last_bit() {
    for value in [0.0, 0.7123, 1.0] {
        let (mut buffer, filters) = wall(|_| value, |_| 1, 0.0);
        assert!(filtered(&buffer, &filters).occlusion.iter().all(|&a| a == value as f32), "{value}");
        buffer.interpolated = buffer.occlusion.clone();
        assert!(filtered(&buffer, &filters).occlusion.iter().all(|&a| a == value as f32), "{value}");
    }
}

#[test]
fn rods_one_voxel_thick_are_kept() {
    let rod = |[i, j, _]: [usize; 3]| i % 5 == 2 && j % 5 == 2;
    let truth = |index| if rod(index) { 0.2 } else { 0.9 };
    // Of another object: only its own voxels count.
    let (buffer, filters) = wall(truth, |index| 1 + u16::from(rod(index)), 0.0);
    let out = filtered(&buffer, &filters);
    for n in 0..out.len() {
        let index = [n % 20, n / 20 % 20, n / 400];
        assert!((f64::from(out.occlusion[n]) - truth(index)).abs() < 1e-3, "{index:?}");
    }
    // Of the same object and flush with it: no noise stands out so far.
    let (buffer, filters) = wall(truth, |_| 1, 0.0);
    let out = filtered(&buffer, &filters);
    for n in (0..out.len()).filter(|n| rod([n % 20, n / 20 % 20, n / 400])) {
        assert!((out.occlusion[n] - 0.2).abs() < 0.1, "{}", out.occlusion[n]);
    }
}

#[test]
fn lonely_voxels_leave_no_speckles() {
    // One value in two hundred is off by three standard deviations and more, as few rays are now and then.
    let (mut buffer, filters) = wall(|_| 0.9, |_| 1, 0.05);
    (0..buffer.len()).filter(|n| n % 199 == 7).for_each(|n| buffer.occlusion[n] -= 0.15);
    let out = filtered(&buffer, &filters);
    let worst = out.occlusion.iter().map(|a| (a - 0.9).abs()).fold(0.0, f32::max);
    assert!(worst < 0.06, "{worst}");
}

#[test]
fn a_jump_is_told_by_the_error() {
    let truth = |[i, _, _]: [usize; 3]| if i < 10 { 0.2 } else { 0.8 };
    let (buffer, filters) = wall(truth, |_| 1, AMPLITUDE);
    let out = filtered(&buffer, &filters);
    let at = |i: usize| f64::from(out.error[i + 20 * (10 + 20 * 10)]);
    assert!(
        at(9) > 0.03 && at(10) > 0.03 && at(2) < 0.02 && at(17) < 0.02,
        "{} {} {} {}",
        at(9),
        at(10),
        at(2),
        at(17)
    );
    let (real, said, _) = errors(&out, truth);
    assert!(real < 0.06 && (0.5..2.0).contains(&(said / real)), "said {said}, real {real}");
}

#[test]
fn what_is_interpolated_right_stays() {
    // A ripple too fine for any window, which the vertices know of.
    let truth = |[i, j, k]: [usize; 3]| 0.5 + 0.1 * f64::from((i + j + k) as u32 % 2);
    let (mut buffer, filters) = wall(truth, |_| 1, 0.08);
    buffer.interpolated = (0..buffer.len()).map(|n| truth([n % 20, n / 20 % 20, n / 400]) as f32).collect();
    let out = filtered(&buffer, &filters);
    let (before, ..) = errors(&buffer, truth);
    let (after, ..) = errors(&out, truth);
    assert!(after < 0.5 * before, "{after} {before}");
}

#[test]
fn filters_can_be_stopped() {
    struct Stopped;
    impl crate::progress::Progress for Stopped {
        fn begin(&self, _: &str, _: u64) {}
        fn advance(&self, _: u64) {}
        fn end(&self) {}
        fn cancelled(&self) -> bool {
            true
        }
    }
    let (buffer, filters) = wall(|_| 0.5, |_| 1, 0.0);
    for filter in &filters {
        let mut out = buffer.clone();
        assert!(matches!(filter.apply(&buffer, &mut out, &Stopped), Err(Error::Cancelled)));
    }
}
