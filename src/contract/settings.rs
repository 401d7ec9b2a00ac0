//! The settings.

use crate::error::{Error, Result};

/// What a setting holds.
#[derive(Debug, Clone, Copy)]
pub enum Kind {
    /// A whole number with its default and inclusive bounds.
    Int(u32, u32, u32),
    /// A number with its default and inclusive bounds.
    Float(f32, f32, f32),
    /// A switch with its default.
    Bool(bool),
    /// One of several words: the default, then (identifier, label, description).
    Enum(
        &'static str,
        &'static [(&'static str, &'static str, &'static str)],
    ),
}

/// One setting.
#[derive(Debug, Clone, Copy)]
pub struct SettingSpec {
    /// Name at `scene.dualcone` and in the settings dictionary.
    pub name: &'static str,
    /// Label in the panel.
    pub label: &'static str,
    /// Type, default and range.
    pub kind: Kind,
    /// Tooltip.
    pub doc: &'static str,
}

macro_rules! settings {
    ($($(#[doc = $doc:literal])+ $name:ident: $type:ty = $kind:expr, $label:literal;)+) => {
        /// The settings of a render. The same table makes the add-on's properties.
        #[derive(Debug, Clone, PartialEq)]
        pub struct Settings {
            $($(#[doc = $doc])+ pub $name: $type,)+
        }

        /// The settings, in the order of the panels.
        pub const SETTINGS: &[SettingSpec] = &[
            $(SettingSpec {
                name: stringify!($name),
                label: $label,
                kind: $kind,
                doc: concat!($($doc),+).trim_ascii(),
            },)+
        ];

        impl Settings {
            /// Settings from named values; what is not named keeps its default.
            ///
            /// # Errors
            /// An unknown name, a value of another type or outside its range.
            pub fn from_values(values: &[(String, Value)]) -> Result<Self> {
                for (name, _) in values {
                    if !SETTINGS.iter().any(|s| s.name == name) {
                        return Err(Error::Unknown { name: name.clone() });
                    }
                }
                let value = |spec: &SettingSpec| -> Result<Value> {
                    match values.iter().find(|(name, _)| name == spec.name) {
                        Some((_, value)) => value.clone().checked(spec),
                        None => Ok(spec.default()),
                    }
                };
                let mut specs = SETTINGS.iter();
                let mut next = || specs.next().map_or_else(
                    || Err(Error::Missing { field: "settings" }), value);
                Ok(Self { $($name: next()?.into(),)+ })
            }
        }

        impl Default for Settings {
            fn default() -> Self {
                let mut specs = SETTINGS.iter().map(SettingSpec::default);
                // Both lists come from one macro, so they have one length.
                let mut next = || specs.next().unwrap_or(Value::Bool(false));
                Self { $($name: next().into(),)+ }
            }
        }
    };
}

settings! {
    /// How frames are rendered.
    method: Method = Kind::Enum("DUAL_CONE", &[
        ("DUAL_CONE", "Dual Cone", "Borrow samples from neighbouring pixels and frames, weighted per class of light"),
        ("PAPER", "Paper", "The method of Zhou and Chen (2015) as printed, for comparison"),
        ("PATH", "Path Tracing", "Every pixel on its own: the unbiased reference"),
        ("BILATERAL", "Bilateral Filter", "For comparison: a filter guided by normal, albedo and depth"),
        ("IRRADIANCE_CACHE", "Irradiance Cache", "For comparison: diffuse light at few points, interpolated"),
    ]), "Method";
    /// Camera rays per pixel and frame.
    samples: u32 = Kind::Int(64, 1, 65535), "Samples";
    /// Changes the noise pattern, nothing else.
    seed: u32 = Kind::Int(0, 0, 0x7fff_ffff), "Seed";
    /// Path Tracing only: paths that go on from the surface that a camera ray finds.
    gathers: u32 = Kind::Int(1, 1, 64), "Gathers";
    /// Side of the block of pixels that lend samples.
    block: u32 = Kind::Int(7, 1, 15), "Block";
    /// Frames that share samples, counting the frame itself.
    window: u32 = Kind::Int(3, 1, 15), "Frames";
    /// Dual Cone only: from whom a pixel borrows.
    share: Share = Kind::Enum("AUTO", &[
        ("AUTO", "Automatic", "From frames alone where the picture is denoised, else from pixels and frames"),
        ("ALL", "Pixels and Frames", "From the block of pixels, in each frame: the least noise"),
        ("FRAMES", "Frames", "From the same place in other frames: more noise, but none that neighbours have in common, so that a denoiser removes it"),
    ]), "Share";
    /// Paper only: which borrowed samples are tested again for visibility.
    recheck: Recheck = Kind::Enum("LIT", &[
        ("NONE", "None", "Trust the recorded visibility: fast, shadows leak"),
        ("LIT", "Lit", "Test samples that found light"),
        ("ALL", "All", "Test every sample: slow"),
    ]), "Recheck";
    /// Also for a still image, look at the frames around it.
    still_window: bool = Kind::Bool(true), "Stills Look Around";
    /// Frames of an animation that are rendered at once; more share more work and need more memory.
    frames_together: u32 = Kind::Int(16, 1, 64), "Frames Together";
    /// Bounces of light in all.
    max_bounces: u32 = Kind::Int(12, 0, 1024), "Total";
    /// Bounces off diffuse surfaces.
    diffuse_bounces: u32 = Kind::Int(4, 0, 1024), "Diffuse";
    /// Bounces off glossy surfaces.
    glossy_bounces: u32 = Kind::Int(4, 0, 1024), "Glossy";
    /// Bounces through surfaces: refraction and translucency.
    transmission_bounces: u32 = Kind::Int(12, 0, 1024), "Transmission";
    /// Bounces in volumes.
    volume_bounces: u32 = Kind::Int(0, 0, 1024), "Volume";
    /// Transparent surfaces that a ray passes before it ends.
    transparent_max_bounces: u32 = Kind::Int(8, 0, 1024), "Transparent";
    /// Light that a diffuse surface gets by glossy reflection: bright and noisy.
    caustics_reflective: bool = Kind::Bool(true), "Reflective Caustics";
    /// Light that a diffuse surface gets through glass: bright and noisy.
    caustics_refractive: bool = Kind::Bool(true), "Refractive Caustics";
    /// Widens glossy reflection after wide bounces, against noise from caustics; 0 leaves it right. Cycles has 1 by default.
    blur_glossy: f32 = Kind::Float(0.0, 0.0, 10.0), "Filter Glossy";
    /// Limit on each sample of light that comes straight from a light, against fireflies; it makes pictures darker. 0 for none.
    clamp_direct: f32 = Kind::Float(0.0, 0.0, 1e8), "Clamp Direct";
    /// Limit on each sample of light that comes by way of other surfaces, against fireflies; it makes pictures darker. 0 for none; Cycles has 10 by default.
    clamp_indirect: f32 = Kind::Float(0.0, 0.0, 1e8), "Clamp Indirect";
    /// A frame ends early once its noise is this share of its brightness; 0 for never.
    noise_threshold: f32 = Kind::Float(0.0, 0.0, 1.0), "Noise Threshold";
    /// Remove what noise is left with OpenImageDenoise, guided by albedo and normal.
    denoise: bool = Kind::Bool(false), "Denoise";
    /// Seconds a frame may take; 0 for no limit.
    time_limit: f32 = Kind::Float(0.0, 0.0, 1e6), "Time Limit";
    /// Shape of the pixel filter.
    filter: Filter = Kind::Enum("BLACKMAN_HARRIS", &[
        ("BOX", "Box", "Sharpest"),
        ("GAUSSIAN", "Gaussian", "Softest"),
        ("BLACKMAN_HARRIS", "Blackman-Harris", "As Cycles by default"),
    ]), "Pixel Filter";
    /// Width of the pixel filter in pixels; a box is one pixel wide.
    filter_width: f32 = Kind::Float(1.5, 0.01, 10.0), "Width";
    /// The world is not seen by the camera.
    film_transparent: bool = Kind::Bool(false), "Transparent";
    /// Where the film is transparent, clear glass is, too.
    film_transparent_glass: bool = Kind::Bool(false), "Transparent Glass";
    /// Roughness up to which glass counts as clear.
    film_transparent_roughness: f32 = Kind::Float(0.1, 0.0, 1.0), "Roughness Threshold";
}

/// A value handed over for a setting.
#[derive(Debug, Clone, PartialEq)]
pub enum Value {
    /// A whole number.
    Int(i64),
    /// A number.
    Float(f32),
    /// A switch.
    Bool(bool),
    /// A word.
    Word(String),
}

impl Value {
    fn checked(self, spec: &SettingSpec) -> Result<Self> {
        let range = |value: &dyn std::fmt::Display, range: String| Error::Range {
            field: spec.name,
            value: value.to_string(),
            range,
        };
        match (spec.kind, self) {
            (Kind::Int(_, min, max), Value::Int(v)) => {
                if (i64::from(min)..=i64::from(max)).contains(&v) {
                    Ok(Value::Int(v))
                } else {
                    Err(range(&v, format!("{min} to {max}")))
                }
            }
            (Kind::Float(_, min, max), Value::Float(v)) if (min..=max).contains(&v) => {
                Ok(Value::Float(v))
            }
            (Kind::Float(_, min, max), Value::Float(v)) => {
                Err(range(&v, format!("{min} to {max}")))
            }
            (Kind::Float(..), Value::Int(v)) => Value::Float(v as f32).checked(spec),
            (Kind::Bool(_), Value::Bool(v)) => Ok(Value::Bool(v)),
            (Kind::Enum(_, items), Value::Word(v)) => {
                if items.iter().any(|item| item.0 == v) {
                    Ok(Value::Word(v))
                } else {
                    let words: Vec<_> = items.iter().map(|item| item.0).collect();
                    Err(range(&v, words.join(", ")))
                }
            }
            (kind, v) => Err(range(&format!("{v:?}"), format!("{kind:?}"))),
        }
    }
}

impl SettingSpec {
    /// The default of the setting.
    pub fn default(&self) -> Value {
        match self.kind {
            Kind::Int(default, ..) => Value::Int(i64::from(default)),
            Kind::Float(default, ..) => Value::Float(default),
            Kind::Bool(default) => Value::Bool(default),
            Kind::Enum(default, _) => Value::Word(default.to_owned()),
        }
    }
}

// A value that passed `checked` has the type of its setting, so the other arms are never taken.
impl From<Value> for u32 {
    fn from(value: Value) -> Self {
        if let Value::Int(v) = value {
            v as u32
        } else {
            0
        }
    }
}

impl From<Value> for f32 {
    fn from(value: Value) -> Self {
        if let Value::Float(v) = value { v } else { 0.0 }
    }
}

impl From<Value> for bool {
    fn from(value: Value) -> Self {
        value == Value::Bool(true)
    }
}

macro_rules! word {
    ($(#[doc = $doc:literal])+ $name:ident { $($variant:ident = $word:literal),+ }) => {
        $(#[doc = $doc])+
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        #[allow(missing_docs, reason = "the settings table describes each word")]
        pub enum $name { $($variant),+ }

        impl From<Value> for $name {
            fn from(value: Value) -> Self {
                let words = [$(($word, Self::$variant)),+];
                let found = words.iter().find(|(word, _)| value == Value::Word((*word).to_owned()));
                found.unwrap_or(&words[0]).1
            }
        }
    };
}

word! {
    /// How frames are rendered.
    Method { DualCone = "DUAL_CONE", Paper = "PAPER", Path = "PATH", Bilateral = "BILATERAL", IrradianceCache = "IRRADIANCE_CACHE" }
}
word! {
    /// From whom a pixel borrows.
    Share { Automatic = "AUTO", All = "ALL", Frames = "FRAMES" }
}
word! {
    /// Which borrowed samples of the paper's method are tested again for visibility.
    Recheck { None = "NONE", Lit = "LIT", All = "ALL" }
}
word! {
    /// Shape of the pixel filter.
    Filter { Box = "BOX", Gaussian = "GAUSSIAN", BlackmanHarris = "BLACKMAN_HARRIS" }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_have_defaults_and_refuse_what_is_out_of_range() {
        let settings = Settings::from_values(&[("samples".into(), Value::Int(7))]).unwrap();
        assert_eq!(
            settings,
            Settings {
                samples: 7,
                ..Settings::default()
            }
        );
        assert_eq!(Settings::default().method, Method::DualCone);
        assert_eq!(Settings::default().filter, Filter::BlackmanHarris);
        for (name, value) in [
            ("samples", Value::Int(0)),
            ("method", Value::Word("MAGIC".into())),
            ("time_limit", Value::Float(f32::NAN)),
            ("still_window", Value::Int(1)),
            ("colour", Value::Int(1)),
        ] {
            assert!(
                Settings::from_values(&[(name.into(), value)]).is_err(),
                "{name}"
            );
        }
    }
}
