//! Embree 3 on the same rays: a process of its own (`embree.c`) that is asked through pipes.

use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::time::Duration;

use dualcone::math::Ray;
use glam::Vec3;

/// Where `make bench-embree` unpacks Debian's packages.
const UNPACKED: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/build/embree/usr");
const SOURCE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/benches/embree/embree.c");

/// What Embree is asked to do with the rays it was given.
#[derive(Clone, Copy)]
pub enum Query {
    Closest,
    Any,
}

/// Embree with a mesh.
pub struct Embree {
    child: Child,
    input: ChildStdin,
    output: ChildStdout,
}

impl Drop for Embree {
    fn drop(&mut self) {
        // It ends with its input; nothing to do where it has ended before.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

impl Embree {
    /// None, with a word on how to get it, where it is not installed.
    pub fn start(positions: &[Vec3], triangles: &[[u32; 3]]) -> Option<Self> {
        let Some(program) = compiled() else {
            println!(
                "Embree: SKIPPED, not found (make bench-embree, or libembree-dev and a C compiler)"
            );
            return None;
        };
        let libraries = Path::new(UNPACKED).join("lib/x86_64-linux-gnu");
        let child = Command::new(&program)
            .env("LD_LIBRARY_PATH", libraries)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn();
        // Linux keeps a program that runs; nobody else needs it.
        let _ = std::fs::remove_file(&program);
        let mut child = child.ok()?;
        let (input, output) = (child.stdin.take()?, child.stdout.take()?);
        let mut embree = Self {
            child,
            input,
            output,
        };
        let counts = [positions.len() as u32, triangles.len() as u32];
        let indices = counts.iter().chain(triangles.as_flattened());
        let mut indices = indices.flat_map(|index| index.to_ne_bytes());
        let mut message = vec![b'm'];
        message.extend(indices.by_ref().take(8));
        message.extend(bytes(positions));
        message.extend(indices);
        embree.input.write_all(&message).ok()?;
        Some(embree)
    }

    /// Hands over the rays of the queries that follow.
    pub fn set_rays(&mut self, rays: &[Ray]) -> Option<()> {
        let mut message = vec![b'r'];
        message.extend((rays.len() as u32).to_ne_bytes());
        for ray in rays {
            let [[x, y, z], [u, v, w]] = [ray.origin, ray.direction].map(|v| v.to_array());
            let numbers = [x, y, z, ray.t_min, u, v, w, ray.t_max];
            message.extend(numbers.into_iter().flat_map(f32::to_ne_bytes));
        }
        self.input.write_all(&message).ok()
    }

    /// The time that a query of all rays takes, by the faster of its two entries, and the sum of what
    /// was found: of `t`, or of hits.
    pub fn query(&mut self, query: Query) -> Option<(Duration, f64)> {
        let commands = match query {
            Query::Closest => [b'1', b'W'],
            Query::Any => [b'o', b'O'],
        };
        let [one_by_one, wide] = commands.map(|command| self.ask(&[command]));
        one_by_one
            .into_iter()
            .chain(wide)
            .min_by_key(|(time, _)| *time)
    }

    /// The time in which the tree is fitted to moved vertices.
    pub fn refit(&mut self, moved: &[Vec3]) -> Option<Duration> {
        let mut message = vec![b'f'];
        message.extend(bytes(moved));
        Some(self.ask(&message)?.0)
    }

    fn ask(&mut self, message: &[u8]) -> Option<(Duration, f64)> {
        self.input.write_all(message).ok()?;
        self.input.flush().ok()?;
        let mut answer = [[0; 8]; 2];
        self.output.read_exact(answer.as_flattened_mut()).ok()?;
        let [seconds, sum] = answer.map(f64::from_ne_bytes);
        Some((Duration::from_secs_f64(seconds), sum))
    }
}

fn bytes(vectors: &[Vec3]) -> impl Iterator<Item = u8> {
    let numbers = vectors.iter().flat_map(|vector| vector.to_array());
    numbers.flat_map(f32::to_ne_bytes)
}

/// The program, compiled for this machine.
fn compiled() -> Option<PathBuf> {
    let program = std::env::temp_dir().join(format!("dualcone-embree-{}", std::process::id()));
    let unpacked = Path::new(UNPACKED);
    let status = Command::new("cc")
        .args(["-O3", "-march=native", SOURCE, "-o"])
        .arg(&program)
        .arg("-I")
        .arg(unpacked.join("include"))
        .arg("-L")
        .arg(unpacked.join("lib/x86_64-linux-gnu"))
        .args(["-lembree3", "-lm", "-Wl,--allow-shlib-undefined"])
        .stderr(Stdio::null())
        .status();
    status.ok()?.success().then_some(program)
}
