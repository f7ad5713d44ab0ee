//! `write`: the files of an image, one file here a format.
//!
//! A format holds all there is to know of an output: its key in YAML and its extension, what it is made of (voxels, in which
//! arrays, or the mesh), what its key leaves out, its bytes on the disk, and how it is written. The rows of `formats!` are
//! the index: a new format is one file and one row.

mod files;
mod join;
mod png;
mod raw;
pub(super) mod vti;
pub(super) mod vtu;

use std::io::{BufReader, Write};
use std::ops::Range;
use std::path::{Path, PathBuf};

use schemars::JsonSchema;
use serde::ser::SerializeMap;
use serde::{Deserialize, Serialize, Serializer};
use serde_json::{Map, Value, json};

use super::camera::camera;
use super::describe::{Counts, Totals, size};
use super::occlusion;
use super::picture::array_bytes;
use super::piece::{self, Piece};
use super::render::RenderPlan;
use super::scene::ScenePlan;
use super::{Invalid, Keys, LeftOut, Needs, Output, Plan, Ref, Resolver, Run, SceneRun, Stage, StageError, Told};
use crate::geometry::{Dimension, Vector};
use crate::io::{AtomicFile, Error};
use crate::mesh::Mesh;
use crate::occlusion::Estimates;
use crate::render::{Accuracy, Aov, Camera};
use crate::volume::{Array, Grid};

pub(super) use files::PictureFiles;
pub(super) use join::join;

/// Name and version, as files record it.
pub(crate) const PROGRAM: &str = concat!("ao4d ", env!("CARGO_PKG_VERSION"));

/// What a format's files are made of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Content {
    /// The picture's arrays, slab by slab.
    Voxels,
    /// The scene's mesh, as the camera sees it.
    Mesh,
}

/// What a format says of itself.
trait OutputFormat {
    /// What its files are made of.
    const CONTENT: Content;
    /// The fields of the write that its key leaves out.
    const LEFT_OUT: &'static [LeftOut];
    /// Whether its files tell of the pipeline's name and seed.
    const TELLS_PIPELINE: bool = false;

    /// The arrays that it needs of a picture.
    fn arrays(_write: &WritePlan) -> Vec<Aov> {
        Vec::new()
    }

    /// Bytes of its numbers a voxel of the image, before compression.
    fn voxel_bytes(_write: &WritePlan, _image: Image) -> u64 {
        0
    }

    /// Bytes a voxel that the disk must have left, as far as they are known before.
    fn disk_bytes(write: &WritePlan, image: Image) -> u64 {
        Self::voxel_bytes(write, image)
    }

    /// Opens a file for a picture's arrays.
    fn open(_file: Opening) -> Result<Option<Box<dyn VoxelFile>>, Error> {
        Ok(None)
    }

    /// What the part of a file is called that a piece of a run makes.
    fn part(file: &Path) -> PathBuf {
        file.to_owned()
    }

    /// Opens a part for some layers of a picture's arrays.
    fn open_part(file: Opening) -> Result<Option<Box<dyn VoxelFile>>, Error> {
        Self::open(file)
    }

    /// Reads a part: as many voxels in all, with the arrays that the format needs of a picture, in its order.
    fn read_part(_path: &Path, _write: &WritePlan, _image: Image, _voxels: usize) -> Result<Vec<Array>, Error> {
        Ok(Vec::new())
    }

    /// Writes the list of the parts of a picture, each with its layers and where it is.
    fn write_list(
        _path: &Path,
        _write: &WritePlan,
        _image: Image,
        _grid: &Grid,
        _parts: &[(Range<usize>, String)],
    ) -> Result<u64, Error> {
        Ok(0)
    }

    /// Whether parts have such a list.
    const LISTED: bool = false;

    /// Puts another text in the place of the one that a file tells of the pipeline; none if its files tell none.
    const RETELL: Option<Retell> = None;

    /// Writes a file of a mesh; returns its length, and how many simplices had to be left out.
    fn write_mesh<const D: usize>(
        _path: &Path,
        _told: &str,
        _mesh: &Mesh<D>,
        _camera: &Camera<D>,
        _found: Found<D>,
        _part: Option<MeshPart>,
    ) -> Result<(u64, usize), Error> {
        Ok((0, 0))
    }
}

/// What decides how many numbers a voxel has.
#[derive(Clone, Copy, Debug)]
pub(in crate::stages) struct Image {
    /// The scene's dimension.
    dimension: Dimension,
    /// Layers of surfaces.
    layers: usize,
}

impl Image {
    pub(in crate::stages) fn of(plan: &Plan, render: &RenderPlan) -> Self {
        Self { dimension: plan[render.scene].dimension, layers: render.layers }
    }

    /// Bytes that a voxel takes in an array, or in those of all layers.
    fn bytes(self, aov: Aov) -> u64 {
        array_bytes(aov, self.dimension, self.layers)
    }
}

/// Writes the file at the path again, with another text of the pipeline; returns its length.
pub(in crate::stages) type Retell = fn(&Path, &WritePlan, &str) -> Result<u64, Error>;

/// What is known at the vertices of a mesh.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Found<'a, const D: usize> {
    /// Ambient occlusion.
    pub values: Option<&'a Estimates>,
    /// The vector b.
    pub vectors: Option<&'a [Vector<D>]>,
}

/// The part of a mesh that a piece of a run writes: the simplices whose first vertex is among these.
pub(super) struct MeshPart<'a> {
    /// The vertices.
    pub vertices: Range<usize>,
    /// The list of all parts, and where they are, if it is this one's to write.
    pub list: Option<(&'a Path, Vec<String>)>,
}

impl<'a> MeshPart<'a> {
    /// The part of a piece, of a mesh with so many vertices; the first piece writes the list.
    pub fn of(piece: Piece, vertices: usize, file: &Path, list: &'a Path) -> Self {
        let list = (piece.index() == 0).then(|| (list, parts_of(file, Piece::all(piece.count()))));
        Self { vertices: piece.share(vertices), list }
    }

    /// Whether a simplex belongs to it.
    pub fn has<const D: usize>(&self, simplex: &[u32; D]) -> bool {
        has_first(&self.vertices, simplex)
    }
}

/// Whether the first vertex of a simplex, in the mesh's order, is among these.
pub(super) fn has_first<const D: usize>(vertices: &Range<usize>, simplex: &[u32; D]) -> bool {
    simplex.iter().min().is_some_and(|&first| vertices.contains(&(first as usize)))
}

/// Where the parts of a file of the pieces of a run are, as each of them names it.
pub(super) fn parts_of(file: &Path, pieces: impl Iterator<Item = Piece>) -> Vec<String> {
    pieces.map(|piece| piece::beside(file, piece)).collect()
}

/// What a file is opened with.
struct Opening<'a> {
    path: &'a Path,
    plan: &'a Plan,
    write: &'a WritePlan,
    /// The picture's render; of a frame of an animation the one that has its camera.
    render: &'a RenderPlan,
    /// Of a part its own layers alone.
    grid: &'a Grid,
    /// Of a part which of the picture's layers is its first.
    first_layer: usize,
    mesh_hash: &'a str,
    told: &'a str,
}

/// An open file that takes a picture slab by slab.
trait VoxelFile {
    /// Takes layers, `first` being the number of the first; `slab` has the arrays that the format needs, in its order.
    fn add_slab(&mut self, first: usize, slab: &[&Array]) -> Result<(), Error>;

    /// Takes note of how far off the picture's occlusion is, once all layers are there.
    fn tell(&mut self, _accuracy: &Accuracy) {}

    /// Completes the file and gives it its name; returns its length.
    fn finish(self: Box<Self>) -> Result<u64, Error>;
}

/// Builds the index from its rows.
macro_rules! formats {
    ($($(#[$doc:meta])+ $key:ident: $name:ident;)+) => {
        /// Files of an image. At least one of `vti`, `raw`, `vtu` and `png`.
        #[derive(Clone, Debug, Default, Deserialize, JsonSchema, PartialEq)]
        #[serde(deny_unknown_fields)]
        pub struct WriteSpec {
            /// A name for later stages to refer to.
            pub id: Option<String>,
            /// The render, by its id.
            pub input: Option<String>,
            $($(#[$doc])+ pub $key: Option<String>,)+
            /// What the `.vti` holds (default `[rgba, ambient_occlusion, opacity]`; also `coverage` where light passes objects,
            /// and of a render with `layers` all arrays of layers). `bent_normal` is also put into the `.vtu`.
            pub arrays: Option<Vec<Aov>>,
            /// How the `.vti` stores numbers (default `appended`).
            pub encoding: Option<Encoding>,
            /// How the `.vti` packs them (default `none`).
            pub compression: Option<Compression>,
        }

        /// A format of files.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
        pub enum Format {
            $($(#[$doc])+ $name,)+
        }

        impl Format {
            /// All of them.
            pub const ALL: &[Self] = &[$(Self::$name),+];

            /// Its key in YAML, which is also its extension.
            pub fn key(self) -> &'static str {
                match self { $(Self::$name => stringify!($key)),+ }
            }

            /// What its files are made of.
            pub fn content(self) -> Content {
                match self { $(Self::$name => <$key::$name>::CONTENT),+ }
            }

            /// The arrays that it needs of a picture.
            pub fn arrays(self, write: &WritePlan) -> Vec<Aov> {
                match self { $(Self::$name => <$key::$name>::arrays(write)),+ }
            }

            /// The fields of the write that its key leaves out.
            pub fn left_out(self) -> &'static [LeftOut] {
                match self { $(Self::$name => <$key::$name>::LEFT_OUT),+ }
            }

            fn tells_pipeline(self) -> bool {
                match self { $(Self::$name => <$key::$name>::TELLS_PIPELINE),+ }
            }

            pub(in crate::stages) fn voxel_bytes(self, write: &WritePlan, image: Image) -> u64 {
                match self { $(Self::$name => <$key::$name>::voxel_bytes(write, image)),+ }
            }

            pub(in crate::stages) fn disk_bytes(self, write: &WritePlan, image: Image) -> u64 {
                match self { $(Self::$name => <$key::$name>::disk_bytes(write, image)),+ }
            }

            fn open(self, file: Opening) -> Result<Option<Box<dyn VoxelFile>>, Error> {
                match self { $(Self::$name => <$key::$name>::open(file)),+ }
            }

            pub(in crate::stages) fn retell(self) -> Option<Retell> {
                match self { $(Self::$name => <$key::$name>::RETELL),+ }
            }

            fn part(self, file: &Path) -> PathBuf {
                match self { $(Self::$name => <$key::$name>::part(file)),+ }
            }

            fn open_part(self, file: Opening) -> Result<Option<Box<dyn VoxelFile>>, Error> {
                match self { $(Self::$name => <$key::$name>::open_part(file)),+ }
            }

            fn read_part(self, path: &Path, write: &WritePlan, image: Image, voxels: usize) -> Result<Vec<Array>, Error> {
                match self { $(Self::$name => <$key::$name>::read_part(path, write, image, voxels)),+ }
            }

            fn is_listed(self) -> bool {
                match self { $(Self::$name => <$key::$name>::LISTED),+ }
            }

            fn write_list(
                self,
                path: &Path,
                write: &WritePlan,
                image: Image,
                grid: &Grid,
                parts: &[(Range<usize>, String)],
            ) -> Result<u64, Error> {
                match self { $(Self::$name => <$key::$name>::write_list(path, write, image, grid, parts)),+ }
            }

            fn write_mesh<const D: usize>(
                self,
                path: &Path,
                told: &str,
                mesh: &Mesh<D>,
                camera: &Camera<D>,
                found: Found<D>,
                part: Option<MeshPart>,
            ) -> Result<(u64, usize), Error> {
                match self { $(Self::$name => <$key::$name>::write_mesh(path, told, mesh, camera, found, part)),+ }
            }

            /// The file that is written under its key.
            fn named(self, spec: &WriteSpec) -> Option<&str> {
                match self { $(Self::$name => spec.$key.as_deref()),+ }
            }
        }
    };
}

formats! {
    /// VTK image data, for ParaView: `NAME.vti`.
    vti: Vti;
    /// Bare float32 RGB triples, x fastest, no header: `NAME.raw`.
    raw: Raw;
    /// The scene's mesh as the camera sees it: `NAME.vtu`.
    vtu: Vtu;
    /// A quick look at slices through the image: `NAME.png`.
    png: Png;
}

/// How a `.vti` stores numbers.
#[derive(Clone, Copy, Debug, Default, Deserialize, JsonSchema, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Encoding {
    /// As they are, after the XML.
    #[default]
    Appended,
    /// As base64 text inside the XML.
    Inline,
}

/// How a `.vti` packs numbers.
#[derive(Clone, Copy, Debug, Default, Deserialize, JsonSchema, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Compression {
    /// Not at all.
    #[default]
    None,
    /// Smaller.
    Zlib,
    /// Faster.
    Lz4,
}

/// Files of an image, as understood.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct WritePlan {
    /// The image.
    pub render: Ref<RenderPlan>,
    /// The files, each format at most once.
    pub files: Files,
    /// What the image data holds, in this order.
    pub arrays: Vec<Aov>,
    /// Whether the pipeline says which; else figures may add what they need.
    pub arrays_given: bool,
    /// How it stores numbers.
    pub encoding: Encoding,
    /// How it packs them.
    pub compression: Compression,
}

/// The files of a write. As JSON a mapping of all formats, with nothing for those that aren't written.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Files(Vec<WriteFile>);

/// A file of a write.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct WriteFile {
    /// Its format.
    pub format: Format,
    /// Its path below `out`.
    pub path: PathBuf,
}

impl Serialize for Files {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(Some(Format::ALL.len()))?;
        for &format in Format::ALL {
            map.serialize_entry(format.key(), &self.get(format).map(|path| path.to_string_lossy()))?;
        }
        map.end()
    }
}

impl Files {
    /// The file of this format.
    pub fn get(&self, format: Format) -> Option<&Path> {
        self.0.iter().find(|file| file.format == format).map(|file| file.path.as_path())
    }

    /// All of them.
    pub fn iter(&self) -> impl Iterator<Item = &WriteFile> {
        self.0.iter()
    }
}

impl WritePlan {
    /// Whether a file of it is one of the mesh.
    pub(super) fn has_mesh(&self) -> bool {
        self.files.iter().any(|file| file.format.content() == Content::Mesh)
    }

    /// Whether its files have the vector b, at voxels or at vertices.
    pub(super) fn has_directions(&self) -> bool {
        self.arrays_given && self.arrays.contains(&Aov::BentNormal)
    }

    /// The names of the arrays that its image data hold, in that order.
    pub fn array_names(&self, plan: &Plan) -> Vec<String> {
        self.arrays.iter().flat_map(|aov| aov.names(plan[self.render].layers)).collect()
    }

    /// The files with this content that have to be made.
    pub(super) fn stale(&self, content: Content, stale: &dyn Fn(&Path) -> bool) -> Vec<&WriteFile> {
        self.files.iter().filter(|file| file.format.content() == content && stale(&file.path)).collect()
    }
}

/// What the key of a mesh leaves out of its render: it is the same whatever the image is like.
const MESH_LEFT_OUT: &[LeftOut] = &[
    LeftOut::new("/dimensions", "a mesh has no voxels"),
    LeftOut::new("/shading", "a mesh has the values of its vertices"),
    LeftOut::new("/denoise", "a mesh has no voxels"),
    LeftOut::new("/tolerance", "a mesh has no voxels"),
    LeftOut::new("/supersample", "a mesh has no voxels"),
    LeftOut::new("/layers", "a mesh has no voxels"),
    LeftOut::new("/dilate", "a mesh has no voxels"),
    LeftOut::new("/lighting", "a mesh is not lit"),
    LeftOut::new("/screen_space", "a mesh is not looked at in an image"),
];

impl Stage for WritePlan {
    type Spec = WriteSpec;
    const KIND: &'static str = "write";
    const LIST: &'static str = "writes";
    const LEFT_OUT: &'static [LeftOut] = &[
        LeftOut::new("/render", "the key of the render itself takes part"),
        LeftOut::new("/files", "a file doesn't depend on its name, nor on what else is written"),
        LeftOut::new("/arrays_given", "decides what figures add to the arrays; what they are in the end takes part"),
    ];

    fn id(spec: &WriteSpec) -> Option<&str> {
        spec.id.as_deref()
    }

    fn resolve(spec: &WriteSpec, path: &str, resolver: &mut Resolver) -> Result<Self, Invalid> {
        let missing = "there is no earlier `render` to write; put one first";
        let render: Ref<RenderPlan> = resolver.input(path, spec.input.as_deref(), missing)?;
        let mut files = Files::default();
        for &format in Format::ALL {
            if let Some(name) = format.named(spec) {
                let key = format!("{path}.{}", format.key());
                let path = resolver.outputs.claim(&key, name, Some(format.key()))?;
                files.0.push(WriteFile { format, path });
            }
        }
        if files.0.is_empty() {
            let keys: Vec<&str> = Format::ALL.iter().map(|format| format.key()).collect();
            return Err(Invalid::new(path, format!("names no file; give at least one of {}", keys.join(", "))));
        }
        let arrays = arrays(spec.arrays.as_deref(), path, render, resolver)?;
        let has_vtu = files.get(Format::Vtu).is_some();
        if files.get(Format::Vti).is_none() {
            let given = [
                ("arrays", spec.arrays.is_some() && !(has_vtu && arrays.contains(&Aov::BentNormal))),
                ("encoding", spec.encoding.is_some()),
                ("compression", spec.compression.is_some()),
            ];
            for (key, _) in given.into_iter().filter(|(_, given)| *given) {
                resolver.warn(format!("{path}.{key}"), "has no effect without `vti`");
            }
        }
        let (encoding, compression) = (spec.encoding.unwrap_or_default(), spec.compression.unwrap_or_default());
        let arrays_given = spec.arrays.is_some();
        let write = Self { render, files, arrays, arrays_given, encoding, compression };
        if let Some(render) = resolver.plan.get_mut(render) {
            render.arrays.extend(write.files.iter().flat_map(|file| file.format.arrays(&write)));
            render.arrays.sort_unstable();
            render.arrays.dedup();
        }
        Ok(write)
    }

    fn works_on(&self) -> Vec<usize> {
        vec![self.render.index()]
    }

    fn scene(me: Ref<Self>, plan: &Plan) -> Option<Ref<ScenePlan>> {
        Some(plan[plan[me].render].scene)
    }

    fn files(&self) -> Vec<&Path> {
        self.files.iter().map(|file| file.path.as_path()).collect()
    }

    fn outputs(me: Ref<Self>, plan: &Plan, keys: &Keys) -> Vec<Output> {
        let output = |WriteFile { format, path }: &WriteFile| {
            let own: Vec<LeftOut> = Self::LEFT_OUT.iter().chain(format.left_out()).copied().collect();
            let part = match format.content() {
                Content::Voxels => keys.part(plan, me.index(), &own),
                Content::Mesh => {
                    let render = plan[me].render;
                    let left_out: Vec<LeftOut> = RenderPlan::LEFT_OUT.iter().chain(MESH_LEFT_OUT).copied().collect();
                    let fields = super::key::without(plan.fields(me.index()), &own);
                    keys.hash(&(keys.part(plan, render.index(), &left_out), fields, plan[me].has_directions()))
                }
            };
            let pipeline = format.tells_pipeline().then(|| keys.provenance());
            let tells = format.retell().map(|_| path.clone());
            Output { file: path.clone(), beside: Vec::new(), key: keys.hash(&(part, format.key(), pipeline)), tells }
        };
        plan[me].files.iter().map(output).collect()
    }

    /// Parts of pictures with what is known of them, and of meshes; the first piece has the lists of all parts.
    fn parts(me: Ref<Self>, plan: &Plan, keys: &Keys, piece: Piece) -> Vec<Output> {
        let (write, is_first) = (&plan[me], piece.index() == 0);
        let render = &plan[write.render];
        let slab = piece.layers(render.dimensions[2], write.render.nth());
        let mut parts = Vec::new();
        for (output, WriteFile { format, .. }) in Self::outputs(me, plan, keys).into_iter().zip(&write.files.0) {
            let list = (is_first && format.is_listed()).then(|| piece::list_of(&output.file));
            if format.content() == Content::Mesh {
                parts.push(Output { beside: list.into_iter().collect(), ..output });
                continue;
            }
            parts.extend(list.map(|file| {
                let key = keys.hash(&(&output.key, "list"));
                Output { file, beside: Vec::new(), key, tells: None }
            }));
            let Some(slab) = &slab else { continue };
            let (file, key) = (format.part(&output.file), keys.hash(&(&output.key, &slab.own, slab.end)));
            let tells = output.tells.filter(|tells| *tells == file);
            parts.push(Output { beside: vec![piece::record_of(&file)], key, tells, file });
        }
        parts
    }

    fn retell(me: Ref<Self>, plan: &Plan, output: &Path, text: &str) -> Result<u64, Error> {
        let write = &plan[me];
        let file = write.files.iter().find(|file| file.path == output).and_then(|file| file.format.retell());
        file.map_or(Ok(0), |retell| retell(&plan.out.join(output), write, text))
    }

    fn written(me: Ref<Self>, plan: &Plan) -> Value {
        let write = &plan[me];
        if write.files.get(Format::Vti).is_none() {
            return Value::Null;
        }
        let mut written = json!({ "encoding": write.encoding, "compression": write.compression });
        // Else figures add to them, and do so again.
        if write.arrays_given {
            written["arrays"] = json!(write.arrays);
        }
        written
    }

    fn needs(me: Ref<Self>, plan: &Plan, stale: &dyn Fn(&Path) -> bool) -> Needs {
        let write = &plan[me];
        let image = Image::of(plan, &plan[write.render]);
        let voxel = write.files.iter().filter(|file| stale(&file.path)).map(|f| f.format.disk_bytes(write, image));
        Needs { disk: plan[write.render].voxels().saturating_mul(voxel.sum()), ..Needs::default() }
    }

    fn line(me: Ref<Self>, plan: &Plan, counts: &[Counts]) -> String {
        let write = &plan[me];
        let files: Vec<String> = write.files.iter().map(|file| file.path.display().to_string()).collect();
        let packed = write.files.get(Format::Vti).is_some() && write.compression != Compression::None;
        let packed = if packed { " before compression" } else { "" };
        let size = match Self::totals(me, plan, counts).bytes {
            0 => String::new(),
            bytes => format!(" ({}{packed})", size(bytes)),
        };
        format!("{} -> {}{size}", plan.id(write.render), files.join(", "))
    }

    fn totals(me: Ref<Self>, plan: &Plan, _: &[Counts]) -> Totals {
        let write = &plan[me];
        let image = Image::of(plan, &plan[write.render]);
        let voxel: u64 = write.files.iter().map(|file| file.format.voxel_bytes(write, image)).sum();
        Totals { bytes: plan[write.render].voxels().saturating_mul(voxel), ..Totals::default() }
    }

    /// Each format's file under its own key.
    fn show(fields: &mut Map<String, Value>) {
        let shown = std::mem::take(fields);
        for (key, value) in shown {
            match value {
                Value::Object(files) if key == "files" => fields.extend(files),
                _ if key == "arrays_given" => {}
                value => drop(fields.insert(key, value)),
            }
        }
    }

    /// Writes meshes. Pictures were written with the render.
    fn run<const D: usize>(me: Ref<Self>, run: &mut Run, scene: &mut SceneRun<D>) -> Result<Told, StageError> {
        let plan = run.plan;
        let write = &plan[me];
        if let Some(piece) = plan.piece {
            write_lists(me, piece, run)?;
        }
        for WriteFile { format, path } in write.stale(Content::Mesh, &|file| run.is_stale(file)) {
            let render = &plan[write.render];
            if let Some(occlusion) = render.occlusion {
                occlusion::values(occlusion, run, scene)?;
            }
            let directions = match render.occlusion.filter(|_| write.has_directions()) {
                Some(occlusion) => Some(scene.directions_of_mesh(occlusion, run)?),
                None => None,
            };
            let (mesh, camera) = (scene.session.mesh(), camera(&render.camera)?);
            let found = Found {
                values: render.occlusion.map(|occlusion| &*scene.values[&occlusion]),
                vectors: directions.as_deref(),
            };
            let list = piece::list_of(path);
            let part = plan.piece.map(|piece| MeshPart::of(piece, mesh.vertices.len(), path, &list));
            let is_list = part.as_ref().is_some_and(|part| part.list.is_some());
            let (bytes, left_out) = format.write_mesh(&plan.out.join(path), run.told, mesh, &camera, found, part)?;
            if is_list {
                run.made_beside(&list, 0)?;
            }
            let note = format!(
                "{}: {left_out} of {} simplices are not wholly before the eye and are left out",
                path.display(),
                mesh.simplices.len()
            );
            run.made(path, bytes, (left_out > 0).then_some(note).into_iter().collect())?;
        }
        Ok(Told::default())
    }
}

/// Writes the lists of the parts of pictures that have to be made.
fn write_lists(me: Ref<WritePlan>, piece: Piece, run: &mut Run) -> Result<(), StageError> {
    let (plan, write) = (run.plan, &run.plan[me]);
    let render = &plan[write.render];
    let grid = render.grid(plan)?;
    let parts = Piece::of_picture(piece.count(), render.dimensions[2], write.render.nth());
    for WriteFile { format, path } in write.files.iter().filter(|file| file.format.content() == Content::Voxels) {
        let list = piece::list_of(path);
        if format.is_listed() && run.is_stale(&list) {
            let parts: Vec<_> = parts.iter().map(|(p, slab)| (slab.layers(), piece::beside(path, *p))).collect();
            let bytes = format.write_list(&plan.out.join(&list), write, Image::of(plan, render), &grid, &parts)?;
            run.made(&list, bytes, Vec::new())?;
        }
    }
    Ok(())
}

/// Why a render can't have this array, if so.
fn refusal(array: Aov, plan: &Plan, render: Ref<RenderPlan>) -> Option<String> {
    match array {
        Aov::BentNormal => plan[render].no_directions(plan),
        Aov::Bounce | Aov::BounceError if !plan[render].lighting.as_ref().is_some_and(|lighting| lighting.bounce) => {
            Some(format!("render `{}` follows no light from surface to surface; give it `bounce: 1`", plan.id(render)))
        }
        _ => None,
    }
}

/// The arrays that a `.vti` of a render holds, checked.
pub(super) fn arrays(
    given: Option<&[Aov]>,
    path: &str,
    render: Ref<RenderPlan>,
    resolver: &Resolver,
) -> Result<Vec<Aov>, Invalid> {
    let layers = resolver.plan[render].layers;
    let usual = || {
        // Of what light passes, figures show where something is.
        let plan = &resolver.plan;
        let coverage = plan[plan[render].scene].is_translucent().then_some(&Aov::Coverage);
        let of_layers = Aov::ALL.iter().filter(|aov| layers > 0 && aov.needs_layers());
        let usual = [Aov::Rgba, Aov::AmbientOcclusion, Aov::Opacity];
        usual.iter().chain(coverage).chain(of_layers).copied().collect()
    };
    let arrays = given.map_or_else(usual, <[Aov]>::to_vec);
    if arrays.is_empty() {
        return Err(Invalid::new(format!("{path}.arrays"), "the list is empty; name at least one array"));
    }
    for (i, array) in arrays.iter().enumerate() {
        if arrays[..i].contains(array) {
            return Err(Invalid::new(format!("{path}.arrays[{i}]"), format!("`{}` stands twice", array.name())));
        }
        if array.is_layered() && layers == 0 {
            let (id, name) = (resolver.plan.id(render), array.name());
            let message = format!("render `{id}` has no layers for `{name}`; give it `layers`, as many as are wanted");
            return Err(Invalid::new(format!("{path}.arrays[{i}]"), message));
        }
        if *array == Aov::Light && resolver.plan[render].lighting.is_none() {
            let id = resolver.plan.id(render);
            let message =
                format!("render `{id}` is not lit; give it `lights`, `ambient`, `sky`, `bounce` or `depth_cue`");
            return Err(Invalid::new(format!("{path}.arrays[{i}]"), message));
        }
        if let Some(message) = refusal(*array, &resolver.plan, render) {
            return Err(Invalid::new(format!("{path}.arrays[{i}]"), message));
        }
    }
    Ok(arrays)
}

/// Copies a file to one that takes its place when it is whole: `copy` is given both. Returns its length.
fn copy_over(
    path: &Path,
    copy: impl FnOnce(BufReader<std::fs::File>, &mut AtomicFile) -> Result<(), Error>,
) -> Result<u64, Error> {
    let failed = |cause| Error::File { path: path.to_owned(), action: "be read", cause };
    let source = BufReader::with_capacity(1 << 18, crate::input::open(path).map_err(failed)?);
    let mut file = AtomicFile::create(path)?;
    copy(source, &mut file).map_err(AtomicFile::name_in(path))?;
    file.commit()
}

/// Writes a file in one piece; returns its length.
///
/// # Errors
/// If that fails; there is no file then, or the one that was there before.
pub(crate) fn write_whole(path: &Path, bytes: &[u8]) -> Result<u64, Error> {
    let mut file = AtomicFile::create(path)?;
    file.write_all(bytes).map_err(Error::from).map_err(AtomicFile::name_in(path))?;
    file.commit()
}
