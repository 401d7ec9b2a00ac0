//! The boundary, written once: every array and every setting that crosses from the add-on into the
//! renderer. Rust checks against these tables, the add-on builds its properties from them, and a
//! test renders them to `docs/contract.md`.

mod arrays;
mod given;
mod passes;
mod settings;

pub use arrays::{ArraySpec, CONTENT, Dtype, FRAME, GRID, IMAGE, MESH, MESH_MOTION};
pub use given::{Arrays, Given, Numbers};
pub use passes::{Keep, PASSES, PassSpec, always_kept};
pub use settings::{Filter, Kind, Method, Recheck, SETTINGS, SettingSpec, Settings, Share, Value};
