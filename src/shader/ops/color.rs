//! Colours.

use glam::Vec3A;

use super::super::operation::Args;
use super::names;
use crate::math::luminance;
use crate::optics::observer::{self, CIE_1931, rgb_from_xyz};

/// Hue, saturation and value in 0 to 1.
fn hsv_from_rgb(rgb: Vec3A) -> Vec3A {
    let (max, min) = (rgb.max_element(), rgb.min_element());
    let range = max - min;
    let saturation = if max == 0.0 { 0.0 } else { range / max };
    if saturation == 0.0 {
        return Vec3A::new(0.0, 0.0, max);
    }
    Vec3A::new(hue(rgb, max, range), saturation, max)
}

fn hue(rgb: Vec3A, max: f32, range: f32) -> f32 {
    let [red, green, blue] = ((max - rgb) / range).to_array();
    let sixths = if rgb.x == max {
        blue - green
    } else if rgb.y == max {
        2.0 + red - blue
    } else {
        4.0 + green - red
    };
    (sixths / 6.0).rem_euclid(1.0)
}

fn rgb_from_hsv(hsv: Vec3A) -> Vec3A {
    let [hue, saturation, value] = hsv.to_array();
    // As Cycles: any hue beyond 0 to 1 lies between magenta and red.
    let sixths = 6.0 * if hue == 1.0 { 0.0 } else { hue };
    let hue = match sixths {
        0.0..6.0 => sixths / 6.0,
        _ => (5.0 + sixths - sixths.floor()) / 6.0,
    };
    value * (1.0 - saturation * (1.0 - pure_hue(hue)))
}

/// The saturated colour of full value with this hue; beyond 0 to 1 it stays red, as in Cycles.
fn pure_hue(hue: f32) -> Vec3A {
    let sixths = hue * 6.0;
    let ramp = Vec3A::new(
        (sixths - 3.0).abs() - 1.0,
        2.0 - (sixths - 2.0).abs(),
        2.0 - (sixths - 4.0).abs(),
    );
    ramp.clamp(Vec3A::ZERO, Vec3A::ONE)
}

fn hsl_from_rgb(rgb: Vec3A) -> Vec3A {
    let (max, min) = (rgb.max_element(), rgb.min_element());
    let lightness = (0.5 * (max + min)).min(1.0);
    let range = max - min;
    if range == 0.0 {
        return Vec3A::new(0.0, 0.0, lightness);
    }
    let saturation = if lightness > 0.5 {
        range / (2.0 - max - min)
    } else {
        range / (max + min)
    };
    Vec3A::new(hue(rgb, max, range), saturation, lightness)
}

fn rgb_from_hsl(hsl: Vec3A) -> Vec3A {
    let [hue, saturation, lightness] = hsl.to_array();
    let chroma = (1.0 - (2.0 * lightness - 1.0).abs()) * saturation;
    (pure_hue(hue) - 0.5) * chroma + lightness
}

pub fn combine(a: &Args) -> Vec3A {
    let color = Vec3A::from_array(a.floats());
    match a.mode(0) {
        0 => color,
        1 => rgb_from_hsv(color),
        _ => rgb_from_hsl(color),
    }
}

pub fn separate(a: &Args) -> Vec3A {
    let color = a.vector(0);
    let color = match a.mode(0) {
        0 => color,
        1 => hsv_from_rgb(color),
        _ => hsl_from_rgb(color),
    };
    Vec3A::splat(color[a.mode(1)])
}

type Blend = fn(f32, Vec3A, Vec3A) -> Vec3A;

/// Blend modes by Blender's identifiers: factor, first and second colour.
#[rustfmt::skip]
const BLENDS: [(&str, Blend); 19] = [
    ("MIX", |t, a, b| a + t * (b - a)),
    ("DARKEN", |t, a, b| a + t * (a.min(b) - a)),
    ("MULTIPLY", |t, a, b| a + t * (a * b - a)),
    ("BURN", |t, a, b| channels(t, a, b, burn)),
    ("LIGHTEN", |t, a, b| a + t * (a.max(b) - a)),
    ("SCREEN", |t, a, b| 1.0 - (1.0 - t + t * (1.0 - b)) * (1.0 - a)),
    ("DODGE", |t, a, b| channels(t, a, b, dodge)),
    ("ADD", |t, a, b| a + t * b),
    ("OVERLAY", |t, a, b| channels(t, a, b, overlay)),
    ("SOFT_LIGHT", soft_light),
    ("LINEAR_LIGHT", |t, a, b| a + t * (2.0 * b - 1.0)),
    ("DIFFERENCE", |t, a, b| a + t * ((a - b).abs() - a)),
    ("EXCLUSION", |t, a, b| (a + t * (b - 2.0 * a * b)).max(Vec3A::ZERO)),
    ("SUBTRACT", |t, a, b| a - t * b),
    ("DIVIDE", |t, a, b| channels(t, a, b, |t, a, b| if b == 0.0 { a } else { (1.0 - t) * a + t * a / b })),
    ("HUE", |t, a, b| with_hue(t, a, b, false)),
    ("SATURATION", saturation),
    ("COLOR", |t, a, b| with_hue(t, a, b, true)),
    ("VALUE", value),
];

pub const BLEND_NAMES: [&str; 19] = names(&BLENDS);

fn channels(t: f32, a: Vec3A, b: Vec3A, f: fn(f32, f32, f32) -> f32) -> Vec3A {
    super::each2(a, b, |a, b| f(t, a, b))
}

fn burn(t: f32, a: f32, b: f32) -> f32 {
    let divisor = 1.0 - t + t * b;
    if divisor <= 0.0 {
        0.0
    } else {
        (1.0 - (1.0 - a) / divisor).clamp(0.0, 1.0)
    }
}

fn dodge(t: f32, a: f32, b: f32) -> f32 {
    let divisor = 1.0 - t * b;
    if a == 0.0 {
        0.0
    } else if divisor <= 0.0 {
        1.0
    } else {
        (a / divisor).min(1.0)
    }
}

fn overlay(t: f32, a: f32, b: f32) -> f32 {
    if a < 0.5 {
        a * (1.0 - t + 2.0 * t * b)
    } else {
        1.0 - (1.0 - t + 2.0 * t * (1.0 - b)) * (1.0 - a)
    }
}

fn soft_light(t: f32, a: Vec3A, b: Vec3A) -> Vec3A {
    let screen = 1.0 - (1.0 - b) * (1.0 - a);
    (1.0 - t) * a + t * ((1.0 - a) * b * a + a * screen)
}

/// The second colour's hue (and saturation) in the first; greys have none to give.
fn with_hue(t: f32, a: Vec3A, b: Vec3A, and_saturation: bool) -> Vec3A {
    let theirs = hsv_from_rgb(b);
    if theirs.y == 0.0 {
        return a;
    }
    let mut own = hsv_from_rgb(a);
    own.x = theirs.x;
    if and_saturation {
        own.y = theirs.y;
    }
    a + t * (rgb_from_hsv(own) - a)
}

fn saturation(t: f32, a: Vec3A, b: Vec3A) -> Vec3A {
    let mut own = hsv_from_rgb(a);
    if own.y == 0.0 {
        return a;
    }
    own.y += t * (hsv_from_rgb(b).y - own.y);
    rgb_from_hsv(own)
}

fn value(t: f32, a: Vec3A, b: Vec3A) -> Vec3A {
    let mut own = hsv_from_rgb(a);
    own.z += t * (hsv_from_rgb(b).z - own.z);
    rgb_from_hsv(own)
}

/// Modes: blend, clamp the factor, clamp the result.
pub fn mix(a: &Args) -> Vec3A {
    let factor = a.float(0);
    let factor = if a.is_on(1) {
        factor.clamp(0.0, 1.0)
    } else {
        factor
    };
    let mixed = BLENDS[a.mode(0)].1(factor, a.vector(1), a.vector(2));
    if a.is_on(2) {
        mixed.clamp(Vec3A::ZERO, Vec3A::ONE)
    } else {
        mixed
    }
}

pub fn hue_saturation(a: &Args) -> Vec3A {
    let [hue, saturation, value, factor] = a.floats();
    let color = a.vector(4);
    let mut hsv = hsv_from_rgb(color);
    hsv.x = (hsv.x + hue + 0.5).rem_euclid(1.0);
    hsv.y = (hsv.y * saturation).clamp(0.0, 1.0);
    hsv.z *= value;
    (factor * rgb_from_hsv(hsv) + (1.0 - factor) * color).max(Vec3A::ZERO)
}

pub fn bright_contrast(a: &Args) -> Vec3A {
    let (bright, contrast) = (a.float(1), a.float(2));
    ((1.0 + contrast) * a.vector(0) + bright - 0.5 * contrast).max(Vec3A::ZERO)
}

pub fn gamma(a: &Args) -> Vec3A {
    let exponent = a.float(1);
    if exponent == 0.0 {
        return Vec3A::ONE;
    }
    a.vector(0)
        .map(|x| if x > 0.0 { x.powf(exponent) } else { x })
}

pub fn invert(a: &Args) -> Vec3A {
    let (factor, color) = (a.float(0), a.vector(1));
    factor * (1.0 - color) + (1.0 - factor) * color
}

/// The colour of a black body, of luminance one, by Planck's law and the observer's functions.
/// Temperatures are held within those of Cycles' fit, 800 to 12000 K, beyond which it is constant.
pub fn blackbody(a: &Args) -> Vec3A {
    /// Second radiation constant [nm K].
    const C2: f32 = 1.438_777e7;
    let temperature = a.float(0).clamp(800.0, 12000.0);
    let mut xyz = [0.0; 3];
    for (row, observer) in (0u8..).zip(CIE_1931) {
        let wavelength = observer::FIRST + observer::STEP * f32::from(row);
        // In powers of 500 nm, which keeps the numbers small.
        let spectrum = (500.0 / wavelength).powi(5) / (C2 / (wavelength * temperature)).exp_m1();
        for (sum, weight) in xyz.iter_mut().zip(observer) {
            *sum += weight * spectrum;
        }
    }
    let rgb = rgb_from_xyz(xyz);
    (rgb / luminance(rgb)).max(Vec3A::ZERO)
}

/// The colour of a wavelength [nm], scaled as in Cycles so that no channel exceeds one.
pub fn wavelength(a: &Args) -> Vec3A {
    (observer::rgb_of(a.float(0)) / 2.52).max(Vec3A::ZERO)
}
