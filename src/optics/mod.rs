//! How much light surfaces reflect and let through: formulas and tables that know nothing of scenes.

mod conductor;
pub mod energy;
pub mod fresnel;
mod layers;
pub mod observer;
mod thin_film;

pub use layers::{Coat, Layers, Sheen, below};
pub use thin_film::ThinFilm;
