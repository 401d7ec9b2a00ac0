//! How much light surfaces reflect and let through: formulas and tables that know nothing of scenes.

pub mod energy;
pub mod fresnel;
mod layers;
pub mod observer;

pub use layers::{Coat, Layers, Sheen, below};
