//! The tone curve of lit pictures: from linear light to what a screen is sent, and back.
//!
//! Light adds up in linear numbers, while screens expect numbers spaced by what the eye tells apart: sRGB (IEC 61966-2-1).
//! Objects' and lights' colours are written as a screen shows them, so [`to_linear`] makes them reflectances; sums of light
//! become bytes by [`to_screen`], which is its inverse from 0 to 1, and white above. Hence an open surface in light of 1 shows
//! just the colour that it was given, as it does in a picture without lights.

/// The part of linear light that a screen is to show, 0 to 1: sRGB, clipped at white.
pub fn to_screen(light: f64) -> f64 {
    match light.max(0.0) {
        white if white >= 1.0 => 1.0,
        dark if dark <= 0.003_130_8 => 12.92 * dark,
        light => 1.055 * libm::pow(light, 1.0 / 2.4) - 0.055,
    }
}

/// The linear light of a number from 0 to 1 that a screen is sent.
pub fn to_linear(shown: f64) -> f64 {
    if shown <= 0.040_45 { shown / 12.92 } else { libm::pow((shown + 0.055) / 1.055, 2.4) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_curve_is_srgb() {
        // From the standard's tables: a middle grey, and the ends.
        assert!((to_linear(0.5) - 0.214_041).abs() < 1e-6);
        assert!((to_screen(0.18) - 0.461_356).abs() < 1e-6);
        assert_eq!([0.0, 1.0, 7.0, -1.0].map(to_screen), [0.0, 1.0, 1.0, 0.0]);
        for byte in 0..=255 {
            let shown = f64::from(byte) / 255.0;
            assert_eq!((to_screen(to_linear(shown)) * 255.0).round(), f64::from(byte));
        }
    }
}
