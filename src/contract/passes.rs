//! The passes.

use crate::error::{Error, Result};

/// What a film keeps of a pass, and how its numbers come of that.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Keep {
    /// What every film keeps.
    Always,
    /// The numbers of the first sample: they do not average.
    First,
    /// The sum over the samples, for their mean.
    Mean,
    /// The same and the number of samples that have any, for the mean over those.
    MeanSeen,
    /// The sum over the samples, to divide by that of another pass, which is then kept too.
    Over(&'static str),
    /// The sums over the samples of several passes, for their means.
    Means,
    /// Numbers that name things, and the sums of their weights over the samples: two things for each
    /// of several passes, the heaviest first.
    Ranked,
}

/// One render pass.
#[derive(Debug, Clone, Copy)]
pub struct PassSpec {
    /// Name as Blender's render layer shows it.
    pub name: &'static str,
    /// Channel letters.
    pub channels: &'static str,
    /// Blender's pass type: COLOR, VECTOR or VALUE.
    pub kind: &'static str,
    /// What a film keeps of it.
    pub keep: Keep,
    /// What it is.
    pub doc: &'static str,
}

impl PassSpec {
    /// Whether it shows light, which the film's exposure scales.
    pub fn is_light(&self) -> bool {
        LIGHT.contains(&self.name) || matches!(self.keep, Keep::Over(_))
    }

    /// Bytes that a pixel takes for it beside what it takes in any case: a sum and a result for each
    /// channel.
    pub fn extra_bytes(&self) -> usize {
        match self.keep {
            Keep::Always => 0,
            _ => 2 * size_of::<f32>() * self.channels.len(),
        }
    }

    /// The row of a pass, and its key: what stands behind the first dot of its name, where several
    /// passes share a row.
    ///
    /// # Errors
    /// A name that the table does not have.
    pub fn named(name: &str) -> Result<(&'static Self, &str)> {
        let (row, key) = name.split_once('.').unwrap_or((name, ""));
        let found = PASSES
            .iter()
            .find(|spec| spec.name == row && spec.is_keyed() != key.is_empty());
        let found = found.ok_or_else(|| Error::Unknown { name: name.into() });
        Ok((found?, key))
    }

    /// Whether there may be several passes of this row, told apart by a key behind its name.
    pub fn is_keyed(&self) -> bool {
        matches!(self.keep, Keep::Means | Keep::Ranked)
    }
}

const fn pass(
    name: &'static str,
    channels: &'static str,
    kind: &'static str,
    keep: Keep,
    doc: &'static str,
) -> PassSpec {
    PassSpec {
        name,
        channels,
        kind,
        keep,
        doc,
    }
}

use Keep::{Always, First, Mean, MeanSeen, Means, Over, Ranked};

/// Every pass that can be rendered, called as Blender 5 calls it.
#[rustfmt::skip] // One line each.
pub const PASSES: &[PassSpec] = &[
    pass("Combined", "RGBA", "COLOR", Always, "Radiance and coverage; colour is premultiplied by alpha."),
    pass("Depth", "Z", "VALUE", Always, "Distance along the viewing axis in the first sample [m]; 1e10 for the background."),
    pass("Mist", "Z", "VALUE", Mean, "From 0 near the camera to 1 in the distance, by the world's mist settings; 1 for the background."),
    pass("Position", "XYZ", "VECTOR", First, "World space, in the first sample [m]; 0 for the background."),
    pass("Normal", "XYZ", "VECTOR", Always, "Mean shading normal in world space."),
    pass("Vector", "XYZW", "VECTOR", MeanSeen, "How the surface moves in the picture: from the frame before to this one in X and Y, from this one to the next in Z and W [pixel]."),
    pass("UV", "UVA", "VECTOR", Mean, "Mean texture coordinate of the map that is active for rendering, and the share of surfaces that have one."),
    pass("Object Index", "X", "VALUE", First, "Pass index of the object in the first sample; 0 for the background."),
    pass("Material Index", "X", "VALUE", First, "Pass index of the material in the first sample; 0 for the background."),
    pass("Diffuse Direct", "RGB", "COLOR", Over("Diffuse Color"), "Light that comes straight from its source and is scattered by diffuse and translucent closures, over their colour."),
    pass("Diffuse Indirect", "RGB", "COLOR", Over("Diffuse Color"), "The same of light that comes by way of other surfaces."),
    pass("Diffuse Color", "RGB", "COLOR", Mean, "Share of light that those closures scatter."),
    pass("Glossy Direct", "RGB", "COLOR", Over("Glossy Color"), "Light that comes straight from its source and is mirrored, over the colour."),
    pass("Glossy Indirect", "RGB", "COLOR", Over("Glossy Color"), "The same of light that comes by way of other surfaces."),
    pass("Glossy Color", "RGB", "COLOR", Mean, "Share of light that is mirrored."),
    pass("Transmission Direct", "RGB", "COLOR", Over("Transmission Color"), "Light that comes straight from its source and is refracted, over the colour."),
    pass("Transmission Indirect", "RGB", "COLOR", Over("Transmission Color"), "The same of light that comes by way of other surfaces."),
    pass("Transmission Color", "RGB", "COLOR", Mean, "Share of light that is refracted."),
    pass("Emission", "RGB", "COLOR", Mean, "Light of glowing surfaces and lamps that the camera sees."),
    pass("Environment", "RGB", "COLOR", Mean, "Light of the world that the camera sees."),
    pass("Light Group", "RGB", "COLOR", Means, "What Combined has of the lamps, glowing surfaces and world of a light group, `Light Group.` and its number; by paths of its own."),
    pass("Volume Direct", "RGB", "COLOR", Mean, "Light that comes straight from its source and is scattered by media."),
    pass("Volume Indirect", "RGB", "COLOR", Mean, "The same of light that comes by way of other places."),
    pass("Ambient Occlusion", "RGB", "COLOR", Mean, "Share of directions above the surface in which nothing is near, weighted by their cosine."),
    pass("Shadow Catcher", "RGB", "COLOR", Always, "Share of its light that things leave to shadow catchers; 1 where there are none."),
    pass("CryptoObject", "rgba", "COLOR", Ranked, "Cryptomatte: names of two objects and the shares of the pixel that they cover; `CryptoObject.00` has the two that cover most."),
    pass("CryptoMaterial", "rgba", "COLOR", Ranked, "The same of materials."),
    pass("CryptoAsset", "rgba", "COLOR", Ranked, "The same of assets: objects with all their children."),
    pass("AOV Color", "RGBA", "COLOR", Means, "Colour that AOV Output nodes send to a pass of the user's own, `AOV Color.` and the hash of its name; alpha is the share of surfaces that send any."),
    pass("AOV Value", "X", "VALUE", Means, "The same of a number."),
    pass("Denoising Normal", "XYZ", "VECTOR", Mean, "Mean shading normal in the camera's space, with Z to the front; of what mirrors and clear glass show, not their own."),
    pass("Denoising Albedo", "RGB", "COLOR", Mean, "Mean share of light that the surface reflects, or what shines; of what mirrors and clear glass show, times their colour."),
    pass("Denoising Depth", "Z", "VALUE", Mean, "Mean length of the way to what those show, from the near clipping plane [m]; 0 for the background."),
    pass("Albedo", "RGB", "COLOR", Always, "Mean share of light that the surface reflects."),
    pass("Noisy Image", "RGBA", "COLOR", Always, "Combined before denoising."),
    pass("Sample Count", "X", "VALUE", Always, "Camera rays of the pixel."),
    pass("Borrowing", "X", "VALUE", Always, "From where the pixel borrows samples: 1 from all frames, 0.5 from its own frame only, 0 from nowhere, where it was found to be better off so."),
    pass("Effective Samples", "X", "VALUE", Always, "Gather samples that the pixel's indirect light is worth, borrowed ones included."),
];

/// Names of the passes that cost nothing: every film keeps them.
pub fn always_kept() -> Vec<String> {
    let kept = PASSES.iter().filter(|spec| spec.keep == Keep::Always);
    kept.map(|spec| spec.name.to_owned()).collect()
}

/// Passes of light, beside those that are divided by a colour.
const LIGHT: &[&str] = &[
    "Combined",
    "Noisy Image",
    "Emission",
    "Environment",
    "Light Group",
    "Volume Direct",
    "Volume Indirect",
];
