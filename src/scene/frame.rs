//! One frame, put together from the boundary arrays.

use std::borrow::Cow;
use std::collections::HashMap;
use std::sync::Arc;

use glam::{Affine3A, Mat3, Mat3A, Mat4, Vec2, Vec3, Vec3A, Vec4};

use super::displacement::displace;
use super::motion::{Bounds, bounds_of_placed};
use super::{
    Camera, CameraMotion, Filling, Flow, ForPasses, Image, Lens, Light, LightKind, Links, Material,
    Mattes, Membership, Mesh, Mist, Moved, Panorama, Placement, Projection, Reach, Trajectory,
    Visibility, World,
};
use crate::contract::{Arrays, FRAME, Given};
use crate::error::{Error, Result};
use crate::math::Ray;
use crate::shader::{Instructions, ObjectInfo, Particle, RayKind};

/// A mesh, placed.
#[derive(Debug, Clone)]
pub struct Instance {
    /// Index into [`SceneFrame::meshes`].
    pub mesh: u32,
    /// Names the same thing in every frame.
    pub key: u64,
    /// Where it is at the frame's own time.
    pub placement: Placement,
    /// Where it is while the shutter is open, if it moves.
    pub motion: Option<Trajectory>,
    /// What the Object Info node tells of it.
    pub info: ObjectInfo,
    /// Material of each slot: indices into [`SceneFrame::materials`].
    pub materials: Vec<u32>,
    /// Cosine of light to its surface below which shadows are those of its smooth form and not of its
    /// flat faces.
    pub lift_cosine: f32,
    /// Which rays meet it.
    pub visibility: Visibility,
    /// Whether camera rays meet a hole in the picture in its place.
    pub is_holdout: bool,
    /// Whether the camera sees only the shadows on it, and not the thing.
    pub is_catcher: bool,
    /// The sets of things that lights are linked to.
    pub membership: Membership,
    /// The things that its light lights, and those that stop it.
    pub links: Links,
}

impl Instance {
    /// The material of a slot, a row of [`SceneFrame::materials`]; one that the instance does not
    /// have counts as its last, as in Blender. `None` where the instance has no slot at all.
    pub fn material_of_slot(&self, slot: u32) -> Option<u32> {
        let last = self.materials.len().checked_sub(1)?;
        Some(self.materials[last.min(slot as usize)])
    }

    /// Where it is at a share of the shutter's time.
    pub fn placement_at(&self, time: f32) -> Cow<'_, Placement> {
        match &self.motion {
            None => Cow::Borrowed(&self.placement),
            Some(motion) => Cow::Owned(Placement::new(motion.at(time))),
        }
    }
}

/// What the camera does while the shutter is open.
#[derive(Debug, Clone, Default)]
pub struct Shutter {
    /// Share of the light that it lets in, in equal parts of its time; empty for all of it.
    pub curve: Vec<f32>,
    /// The camera's way, if it moves.
    pub camera: Option<CameraMotion>,
}

/// Everything one frame shows.
#[derive(Clone)]
pub struct SceneFrame {
    /// The frame's number.
    pub frame: i32,
    /// Meshes, each perhaps shared with other frames.
    pub meshes: Vec<Arc<Mesh>>,
    /// Placed meshes.
    pub instances: Vec<Instance>,
    /// Materials.
    pub materials: Vec<Material>,
    /// Images that the materials name.
    pub images: Vec<Arc<Image>>,
    /// Lamps.
    pub lights: Vec<Light>,
    /// The camera at the frame's own time.
    pub camera: Camera,
    /// What the shutter does.
    pub shutter: Shutter,
    /// The surroundings.
    pub world: World,
    /// What fills them.
    pub medium: Option<Filling>,
    /// What it tells for passes alone.
    pub passes: ForPasses,
}

impl SceneFrame {
    /// A frame from the arrays of [`FRAME`].
    ///
    /// # Errors
    /// An array that breaks the contract, an index to something that is not there, a matrix without
    /// an inverse.
    pub fn new(
        frame: i32,
        meshes: Vec<Arc<Mesh>>,
        images: Vec<Arc<Image>>,
        given: Vec<Given>,
    ) -> Result<Self> {
        let arrays = Arrays::checked(FRAME, given)?;
        let materials = materials(&arrays, images.len())?;
        let camera = camera(&arrays)?;
        let mut instances = instances(&arrays, meshes.len(), materials.len())?;
        set_in_motion(&mut instances, &arrays)?;
        give_particles(&arrays, &mut instances)?;
        let mut frame = Self {
            frame,
            passes: ForPasses {
                mist: mist(&arrays),
                alpha_threshold: arrays.f32s("alpha_threshold")[0],
                ambient_distance: arrays.f32s("ambient_distance")[0],
                flow: flow(&arrays, &camera, &instances, &meshes)?,
                mattes: Mattes {
                    instances: arrays.f32s("instance_mattes").as_chunks().0.to_vec(),
                    materials: arrays.f32s("material_mattes").to_vec(),
                },
            },
            instances,
            lights: lights(&arrays, materials.len())?,
            camera,
            shutter: shutter(&arrays)?,
            world: world(&arrays, &images)?,
            medium: world_medium(&arrays, &materials)?,
            meshes,
            materials,
            images,
        };
        displace(&mut frame);
        Ok(frame)
    }

    /// The frame as it would be without any things but its shadow catchers, which are then seen; `None`
    /// where it has none.
    pub fn catchers(&self) -> Option<Self> {
        let catchers = self.catcher_numbers();
        let catchers = catchers.map(|number| &self.instances[number as usize]);
        let seen = catchers.map(|catcher| Instance {
            visibility: catcher.visibility.with(RayKind::Camera),
            ..catcher.clone()
        });
        let instances: Vec<Instance> = seen.collect();
        (!instances.is_empty()).then(|| Self {
            instances,
            ..self.clone()
        })
    }

    /// The instances that are shadow catchers, in the order of [`SceneFrame::catchers`].
    pub fn catcher_numbers(&self) -> impl Iterator<Item = u32> {
        let numbered = (0u32..).zip(&self.instances);
        numbered
            .filter(|(_, i)| i.is_catcher)
            .map(|(number, _)| number)
    }

    /// The mesh of an instance.
    pub fn mesh_of(&self, instance: u32) -> &Mesh {
        &self.meshes[self.instances[instance as usize].mesh as usize]
    }

    /// Whether anything moves while the shutter is open.
    pub fn is_moving(&self) -> bool {
        self.shutter.camera.is_some()
            || (0..self.instances.len() as u32).any(|instance| self.moves(instance))
    }

    /// Whether an instance moves, or changes its form, while the shutter is open.
    pub fn moves(&self, instance: u32) -> bool {
        self.instances[instance as usize].motion.is_some() || self.mesh_of(instance).is_moving()
    }

    /// The box around an instance, wherever it is while the shutter is open; `None` where its mesh is
    /// empty. Builds the mesh's trees.
    pub fn bounds_of(&self, instance: u32) -> Option<Bounds> {
        let bounds = self.mesh_of(instance).bounds()?;
        let instance = &self.instances[instance as usize];
        Some(match &instance.motion {
            None => bounds_of_placed(instance.placement.world_from_object, bounds),
            Some(motion) => motion.bounds(bounds),
        })
    }

    /// The ray that a point of the film sees at a share of the shutter's time; see [`Camera::ray`].
    pub fn camera_ray(&self, film: Vec2, u_lens: [f32; 2], time: f32) -> Option<Ray> {
        let ray = match &self.shutter.camera {
            None => self.camera.ray(film, u_lens),
            Some(motion) => self.camera.moved(motion, time).ray(film, u_lens),
        };
        Some(ray?.at_time(time))
    }

    /// The material of a triangle.
    pub fn material_of(&self, instance: u32, triangle: u32) -> Option<&Material> {
        let number = self.material_number_of(instance, triangle)?;
        Some(&self.materials[number as usize])
    }

    /// The number of the material of a triangle; see [`Instance::material_of_slot`].
    pub fn material_number_of(&self, instance: u32, triangle: u32) -> Option<u32> {
        let slot = self.mesh_of(instance).faces[triangle as usize].slot;
        self.instances[instance as usize].material_of_slot(slot)
    }

    /// Texture coordinate at a point of a triangle.
    pub fn uv(&self, instance: u32, triangle: u32, barycentric: Vec2) -> Vec2 {
        let corners = &self.mesh_of(instance).faces[triangle as usize].uvs;
        interpolate(corners, barycentric)
    }

    /// Bytes held by the meshes and images of some frames. What they share counts once.
    pub fn memory_bytes<'a>(frames: impl Iterator<Item = &'a Self>) -> usize {
        let (mut meshes, mut images) = (HashMap::new(), HashMap::new());
        for frame in frames {
            meshes.extend(frame.meshes.iter().map(|m| (Arc::as_ptr(m), m)));
            images.extend(frame.images.iter().map(|i| (Arc::as_ptr(i), i)));
        }
        let meshes = meshes.values().map(|mesh| mesh.memory_bytes());
        let images = images.values().map(|image| image.memory_bytes());
        meshes.sum::<usize>() + images.sum::<usize>()
    }
}

/// The value at barycentric coordinates (of corners 1 and 2) between three corner values.
pub fn interpolate<T>(corners: &[T; 3], barycentric: Vec2) -> T
where
    T: Copy + std::ops::Mul<f32, Output = T> + std::ops::Add<Output = T>,
{
    let [a, b, c] = *corners;
    a * (1.0 - barycentric.x - barycentric.y) + b * barycentric.x + c * barycentric.y
}

/// The index, if it names one of `len`; otherwise an error that names it.
fn index(field: &'static str, row: usize, index: i64, len: usize, of: &'static str) -> Result<u32> {
    if index >= 0 && (index as usize) < len {
        Ok(index as u32)
    } else {
        Err(Error::Index {
            field,
            row,
            index,
            len,
            of,
        })
    }
}

fn optional_index(
    field: &'static str,
    row: usize,
    given: i32,
    len: usize,
    of: &'static str,
) -> Result<Option<u32>> {
    if given == -1 {
        return Ok(None);
    }
    index(field, row, i64::from(given), len, of).map(Some)
}

/// `(first, count)` as a range, if it lies within `len`.
fn range(
    field: &'static str,
    row: usize,
    [first, count]: [u32; 2],
    len: usize,
    of: &'static str,
) -> Result<std::ops::Range<usize>> {
    let end = first as usize + count as usize;
    if end > len {
        index(field, row, end as i64 - 1, len, of)?;
    }
    Ok(first as usize..end)
}

fn color(numbers: &[f32], row: usize) -> Vec3A {
    Vec3A::from_slice(&numbers[3 * row..])
}

/// A row-major 3 x 4 matrix.
fn affine(numbers: &[f32], row: usize) -> Affine3A {
    let m: &[f32] = &numbers[12 * row..12 * row + 12];
    let column = |c: usize| Vec3::new(m[c], m[4 + c], m[8 + c]);
    Affine3A::from_mat3_translation(Mat3::from_cols(column(0), column(1), column(2)), column(3))
}

fn inverse(field: &'static str, row: usize, matrix: Affine3A) -> Result<Affine3A> {
    let inverse = matrix.inverse();
    if inverse.is_finite() {
        Ok(inverse)
    } else {
        Err(Error::Singular { field, row })
    }
}

fn instances(arrays: &Arrays, meshes: usize, materials: usize) -> Result<Vec<Instance>> {
    let slot_materials = arrays.u32s("slot_materials");
    for (row, &material) in slot_materials.iter().enumerate() {
        index(
            "slot_materials",
            row,
            i64::from(material),
            materials,
            "materials",
        )?;
    }
    let slots = arrays.u32s("instance_slots").as_chunks::<2>().0;
    let rows = slots
        .iter()
        .zip(arrays.u32s("instance_mesh"))
        .zip(arrays.u64s("instance_key"));
    rows.enumerate()
        .map(|(row, ((&slots, &mesh), &key))| {
            let world_from_object = affine(arrays.f32s("world_from_object"), row);
            inverse("world_from_object", row, world_from_object)?;
            let slots = range(
                "instance_slots",
                row,
                slots,
                slot_materials.len(),
                "material slots",
            )?;
            Ok(Instance {
                mesh: index("instance_mesh", row, i64::from(mesh), meshes, "meshes")?,
                key,
                placement: Placement::new(world_from_object),
                motion: None,
                info: object_info(arrays, row),
                materials: slot_materials[slots].to_vec(),
                lift_cosine: arrays.f32s("instance_lift_cosine")[row],
                visibility: visibility(arrays, row),
                is_holdout: arrays.u32s("instance_holdout")[row] != 0,
                is_catcher: is_catcher(arrays, row),
                membership: Membership {
                    receivers: arrays.u64s("instance_receiver_sets")[row],
                    blockers: arrays.u64s("instance_blocker_sets")[row],
                },
                links: links(arrays, "instance_links", row)?,
            })
        })
        .collect()
}

fn is_catcher(arrays: &Arrays, row: usize) -> bool {
    arrays.u32s("instance_shadow_catcher")[row] != 0
}

fn visibility(arrays: &Arrays, row: usize) -> Visibility {
    let visibility = Visibility::from_bits(arrays.u32s("instance_visibility")[row]);
    match is_catcher(arrays, row) {
        true => visibility.without(RayKind::Camera),
        false => visibility,
    }
}

/// Gives the instances that move their ways.
fn set_in_motion(instances: &mut [Instance], arrays: &Arrays) -> Result<()> {
    let placements = affines(arrays.f32s("motion_placements"));
    let spans = arrays.u32s("motion_spans").as_chunks::<2>().0;
    let rows = arrays.u32s("motion_instances").iter().zip(spans);
    for (row, (&moved, &span)) in rows.enumerate() {
        let field = "motion_instances";
        let moved = index(field, row, i64::from(moved), instances.len(), "instances")?;
        let span = range("motion_spans", row, span, placements.len(), "placements")?;
        let field = "motion_spans";
        let motion = Trajectory::new(&placements[span]).ok_or(Error::Singular { field, row })?;
        instances[moved as usize].motion = Some(motion);
    }
    Ok(())
}

fn affines(numbers: &[f32]) -> Vec<Affine3A> {
    (0..numbers.len() / 12)
        .map(|row| affine(numbers, row))
        .collect()
}

/// The projections of an array of matrices; none for a panorama, which keeps its own.
fn projections(arrays: &Arrays, name: &'static str) -> Result<Vec<Projection>> {
    let matrices = arrays.f32s(name).as_chunks::<16>().0;
    let is_panorama = panorama(arrays)?.is_some();
    let matrices = matrices.iter().filter(|_| !is_panorama);
    matrices
        .map(|rows| Projection::from_matrix(Mat4::from_cols_array(rows).transpose()))
        .collect()
}

fn mist(arrays: &Arrays) -> Mist {
    let [start, depth, exponent] = arrays.f32s("mist")[..3].try_into().unwrap_or_default();
    Mist {
        start,
        depth,
        exponent,
    }
}

fn flow(
    arrays: &Arrays,
    camera: &Camera,
    instances: &[Instance],
    meshes: &[Arc<Mesh>],
) -> Result<Option<Flow>> {
    let [before, after] = affines(arrays.f32s("flow_camera"))[..] else {
        return Ok(None);
    };
    let projections = projections(arrays, "flow_camera_clip")?;
    let there = |placement, side: usize| camera.placed(placement, projections.get(side).copied());
    let vertices = arrays.f32s("flow_vertices").as_chunks::<6>().0;
    let side = |first: usize| {
        let points = vertices.iter().map(|v| Vec3::from_slice(&v[first..]));
        points.collect::<Vec<Vec3>>()
    };
    Ok(Some(Flow {
        cameras: [there(before, 0), there(after, 1)],
        moved: moved(arrays, instances, meshes, vertices.len())?,
        vertices: [side(0), side(3)],
    }))
}

/// For each instance where it is before and after the frame, if it moves.
fn moved(
    arrays: &Arrays,
    instances: &[Instance],
    meshes: &[Arc<Mesh>],
    vertices: usize,
) -> Result<Vec<Option<Moved>>> {
    let mut moved = vec![None; instances.len()];
    let pairs = affines(arrays.f32s("flow_placements"));
    let movers = arrays.u32s("flow_instances").iter();
    let firsts = arrays.i32s("flow_first_vertex");
    let rows = movers.zip(pairs.as_chunks::<2>().0).zip(firsts);
    for (row, ((&instance, &placements), &first)) in rows.enumerate() {
        let field = "flow_instances";
        let instance = index(field, row, instance.into(), instances.len(), "instances")? as usize;
        let field = "flow_first_vertex";
        let first_vertex = optional_index(field, row, first, vertices, "vertices")?;
        if let Some(first) = first_vertex {
            let count = meshes[instances[instance].mesh as usize].vertices.len() as u32;
            range(field, row, [first, count], vertices, "vertices")?;
        }
        moved[instance] = Some(Moved {
            placements,
            first_vertex: first_vertex.map(|first| first as usize),
        });
    }
    Ok(moved)
}

fn shutter(arrays: &Arrays) -> Result<Shutter> {
    let placements = affines(arrays.f32s("camera_motion"));
    let projections = projections(arrays, "camera_motion_clip")?;
    let camera = match placements.len() {
        0 => None,
        _ => Some(CameraMotion::new(&placements, projections)?),
    };
    let curve = arrays.f32s("shutter_curve").to_vec();
    Ok(Shutter { curve, camera })
}

fn materials(arrays: &Arrays, images: usize) -> Result<Vec<Material>> {
    let rows = arrays.f32s("program_tables").as_chunks::<4>().0;
    let instructions = Instructions {
        instructions: arrays.u32s("program_instructions").as_chunks::<4>().0,
        operands: arrays.u32s("program_operands"),
        constants: arrays.f32s("program_constants").as_chunks::<3>().0,
        tables: rows.iter().map(|&row| Vec4::from(row)).collect(),
        images,
    };
    let count = instructions.instructions.len();
    let spans = arrays.u32s("material_programs").as_chunks::<2>().0.iter();
    spans
        .enumerate()
        .map(|(row, &span)| {
            let rows = range("material_programs", row, span, count, "instructions")?;
            Ok(Material {
                pass_index: arrays.f32s("material_index")[row],
                has_bump_correction: arrays.u32s("material_bump_correction")[row] != 0,
                has_transparent_shadow: arrays.u32s("material_transparent_shadow")[row] != 0,
                ..Material::new(&instructions.draft(rows)?)
            })
        })
        .collect()
}

fn object_info(arrays: &Arrays, row: usize) -> ObjectInfo {
    let [index, random] = arrays.f32s("instance_info").as_chunks::<2>().0[row];
    ObjectInfo {
        color: arrays.f32s("instance_color").as_chunks::<4>().0[row].into(),
        index,
        random,
        particle: None,
    }
}

/// Tells instances of the particles that they show.
fn give_particles(arrays: &Arrays, instances: &mut [Instance]) -> Result<()> {
    let numbers = arrays.f32s("particles").as_chunks::<13>().0;
    let rows = arrays.u32s("particle_instances").iter().zip(numbers);
    for (row, (&number, values)) in rows.enumerate() {
        let number = index(
            "particle_instances",
            row,
            i64::from(number),
            instances.len(),
            "instances",
        )?;
        let [number_in_system, age, lifetime, size, vectors @ ..] = *values;
        let vector = |at: usize| Vec3A::new(vectors[at], vectors[at + 1], vectors[at + 2]);
        instances[number as usize].info.particle = Some(Arc::new(Particle {
            index: number_in_system,
            age,
            lifetime,
            size,
            location: vector(0),
            velocity: vector(3),
            angular_velocity: vector(6),
        }));
    }
    Ok(())
}

fn lights(arrays: &Arrays, materials: usize) -> Result<Vec<Light>> {
    (0..arrays.length("L"))
        .map(|row| light(arrays, row, materials))
        .collect()
}

fn light(arrays: &Arrays, row: usize, materials: usize) -> Result<Light> {
    let world_from_light = affine(arrays.f32s("world_from_light"), row);
    inverse("world_from_light", row, world_from_light)?;
    let material = arrays.i32s("light_material")[row];
    Ok(Light {
        kind: light_kind(arrays, row)?,
        key: arrays.u64s("light_key")[row],
        world_from_light,
        scale: color(arrays.f32s("light_scale"), row),
        power: color(arrays.f32s("light_power"), row),
        material: optional_index("light_material", row, material, materials, "materials")?,
        reach: Reach {
            visibility: Visibility::from_bits(arrays.u32s("light_visibility")[row]),
            max_bounces: arrays.u32s("light_max_bounces")[row],
            links: links(arrays, "light_links", row)?,
        },
    })
}

fn light_kind(arrays: &Arrays, row: usize) -> Result<LightKind> {
    let size: [f32; 2] = arrays.f32s("light_size").as_chunks::<2>().0[row];
    let [cone_angle, blend] = arrays.f32s("light_spot").as_chunks::<2>().0[row];
    let soft_falloff = arrays.u32s("light_soft_falloff")[row] != 0;
    let spread = arrays.f32s("light_spread")[row];
    let radius = size[0];
    Ok(match arrays.u32s("light_kind")[row] {
        0 => LightKind::Sun { angle: size[0] },
        1 => LightKind::Point {
            radius,
            soft_falloff,
        },
        2 => LightKind::Spot {
            radius,
            soft_falloff,
            cone_angle,
            blend,
        },
        3 => LightKind::AreaRectangle { size, spread },
        4 => LightKind::AreaEllipse { size, spread },
        kind => {
            return Err(Error::Index {
                field: "light_kind",
                row,
                index: i64::from(kind),
                len: 5,
                of: "kinds of light",
            });
        }
    })
}

fn links(arrays: &Arrays, field: &'static str, row: usize) -> Result<Links> {
    let set =
        |number: u32| index(field, row, i64::from(number), 64, "sets").map(|number| number as u8);
    let [receivers, blockers, number] = arrays.u32s(field).as_chunks::<3>().0[row];
    Ok(Links {
        receivers: set(receivers)?,
        blockers: set(blockers)?,
        group: group(field, row, number)?,
    })
}

fn group(field: &'static str, row: usize, number: u32) -> Result<u8> {
    index(field, row, i64::from(number), 256, "light groups").map(|number| number as u8)
}

fn camera(arrays: &Arrays) -> Result<Camera> {
    let mut rows = [0.0; 16];
    rows.copy_from_slice(arrays.f32s("clip_from_camera"));
    let clip = arrays.f32s("camera_clip");
    let projection = match panorama(arrays)? {
        Some((panorama, shift)) => Projection::Panorama(panorama, shift),
        None => Projection::from_matrix(Mat4::from_cols_array(&rows).transpose())?,
    };
    let aperture = arrays.f32s("camera_lens");
    let lens = Lens {
        radius: aperture[0],
        focus_distance: aperture[1],
        blades: aperture[2].max(0.0) as u32,
        rotation: aperture[3],
        ratio: aperture[4],
    };
    Camera::new(
        affine(arrays.f32s("world_from_camera"), 0),
        projection,
        lens,
        [clip[0], clip[1]],
        arrays.u32s("camera_frame_width")[0],
    )
}

/// The map of a panoramic camera and its shift; none where the projection matrix says it all.
fn panorama(arrays: &Arrays) -> Result<Option<(Panorama, Vec2)>> {
    let mut given = [0.0; 10];
    given.copy_from_slice(arrays.f32s("camera_panorama"));
    let [shift_x, shift_y, p @ ..] = given;
    let panorama = match arrays.u32s("camera_kind")[0] {
        0 => return Ok(None),
        1 => Panorama::Equirectangular {
            longitude: [p[0], p[1]],
            latitude: [p[2], p[3]],
        },
        2 => Panorama::FisheyeEquidistant {
            field_of_view: p[0],
        },
        3 => Panorama::FisheyeEquisolid {
            field_of_view: p[0],
            focal_length: p[1],
            sensor: Vec2::new(p[2], p[3]),
        },
        4 => Panorama::FisheyePolynomial {
            field_of_view: p[0],
            sensor: Vec2::new(p[1], p[2]),
            coefficients: [p[3], p[4], p[5], p[6], p[7]],
        },
        5 => Panorama::MirrorBall,
        6 => Panorama::CubeFace,
        7 => Panorama::Cylinder {
            longitude: [p[0], p[1]],
            height: [p[2], p[3]],
        },
        index => {
            return Err(Error::Index {
                field: "camera_kind",
                row: 0,
                index: index.into(),
                len: 8,
                of: "kinds of camera",
            });
        }
    };
    Ok(Some((panorama, Vec2::new(shift_x, shift_y))))
}

fn world_medium(arrays: &Arrays, materials: &[Material]) -> Result<Option<Filling>> {
    let given = arrays.i32s("world_material")[0];
    let row = optional_index("world_material", 0, given, materials.len(), "materials")?;
    Ok(row.and_then(|row| materials[row as usize].medium.clone()))
}

fn world(arrays: &Arrays, images: &[Arc<Image>]) -> Result<World> {
    let given = arrays.i32s("world_image")[0];
    let image = optional_index("world_image", 0, given, images.len(), "images")?;
    let given = arrays.i32s("world_camera_image")[0];
    let camera_image = optional_index("world_camera_image", 0, given, images.len(), "images")?;
    let mut rows = [0.0; 9];
    rows.copy_from_slice(arrays.f32s("environment_from_world"));
    Ok(World {
        radiance: color(arrays.f32s("world_radiance"), 0),
        image: image.map(|i| images[i as usize].clone()),
        camera_image: camera_image.map(|i| images[i as usize].clone()),
        environment_from_world: Mat3A::from_cols_array(&rows).transpose(),
        reach: Reach {
            visibility: Visibility::from_bits(arrays.u32s("world_visibility")[0]),
            max_bounces: arrays.u32s("world_max_bounces")[0],
            links: Links {
                group: group("world_group", 0, arrays.u32s("world_group")[0])?,
                ..Links::default()
            },
        },
    })
}
