//! `ao4d schema` accepts what the program accepts: every pipeline in `pipelines/`, and the smallest ones of all.

use std::path::{Path, PathBuf};
use std::process::Command;

use ao4d::pipeline::Document;
use serde_json::Value;

struct Schema {
    schemas: boon::Schemas,
    index: boon::SchemaIndex,
}

impl Schema {
    /// As the program prints it.
    fn printed() -> Self {
        let output = Command::new(env!("CARGO_BIN_EXE_ao4d")).arg("schema").output().unwrap();
        assert_eq!(output.status.code(), Some(0));
        let schema: Value = serde_json::from_slice(&output.stdout).unwrap();
        let (mut schemas, mut compiler) = (boon::Schemas::new(), boon::Compiler::new());
        compiler.add_resource("pipeline.json", schema).unwrap();
        let index = compiler.compile("pipeline.json", &mut schemas).unwrap();
        Schema { schemas, index }
    }

    fn accepts(&self, document: &Document) -> Result<(), String> {
        let value: Value = document.decode().unwrap();
        self.schemas.validate(&value, self.index).map_err(|e| e.to_string())
    }
}

fn pipelines(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
        let path = entry.path();
        if path.is_dir() {
            pipelines(&path, found);
        } else if path.extension().is_some_and(|e| e == "yaml") {
            found.push(path);
        }
    }
}

#[test]
fn accepts_every_pipeline_here() {
    let schema = Schema::printed();
    let mut found = Vec::new();
    pipelines(&Path::new(env!("CARGO_MANIFEST_DIR")).join("pipelines"), &mut found);
    for path in found {
        let document = Document::read(&path).unwrap();
        assert_eq!(schema.accepts(&document), Ok(()), "{}", path.display());
    }
}

#[test]
fn accepts_and_refuses_as_the_decoder_does() {
    let schema = Schema::printed();
    let scene = "name: p\nstages:\n  - scene: {objects: []}\n";
    for (stage, right) in [
        ("", true),
        ("  - occlusion: {}\n", true),
        ("  - occlusion: {method: exact, max_distance: 3}\n", true),
        ("  - render: {dimensions: [1, 2, 3], occlusion: none, camera: {eye: [0, 0, 0, 1], height: 2}}\n", true),
        (
            "  - render: {dimensions: [1, 2], lights: [{direction: [0, 1]}, {position: [0], color: \"#ffffff\"}]}\n",
            true,
        ),
        ("  - render: {dimensions: [1, 2], ambient: 0.5, specular: 0, depth_cue: {near: 1, far: 2}}\n", true),
        ("  - render: {dimensions: [1, 2], sky: {gradient: [0, 1]}, bounce: 1}\n", true),
        ("  - render: {dimensions: [1, 2], sky: [0, 1]}\n", false),
        ("  - write: {vti: a.vti, arrays: [bent_normal, irradiance, bounce, bounce_error]}\n", true),
        ("  - render: {dimensions: [1, 2], lights: {direction: [0, 1]}}\n", false),
        ("  - render: {dimensions: [1, 2], lights: [{at: [0, 1]}]}\n", false),
        ("  - render: {dimensions: [1, 2], depth_cue: {near: 1}}\n", false),
        ("  - write: {vti: a.vti, arrays: [rgba, normal], compression: lz4}\n", true),
        ("  - paraview: {state: a.py, input: a, cut: octant}\n", true),
        ("  - paraview: {state: a.py, input: [a, b], cut: {plane: x, at: -0.5}}\n", true),
        ("  - mesh: {vtu: a.vtu, input: a, occlusion: none}\nfolder: /a\ninputs: [{file: b, sha256: \"00\"}]\n", true),
        ("  - mesh: {}\n", false),
        ("  - slice: {vtp: a.vtp, normal: [1, 0, 0, 0], at: 2, input: a, occlusion: none}\n", true),
        ("  - slice: {vtp: a.vtp, range: [-1, 1], count: 9}\n", true),
        ("  - slice: {vtp: a.vtp, range: [-1, 0, 1], count: 9}\n", false),
        ("  - slice: {at: 2}\n", false),
        ("  - wireframe: {vtp: a.vtp, input: a, edges: all, near: 0.1}\n", true),
        ("  - wireframe: {vtp: a.vtp, angle: 20}\n", true),
        ("  - wireframe: {vtp: a.vtp, edges: some}\n", false),
        (
            "  - animate: {frames: 3, vti: a.vti, turn: {plane: xw, from: -90, to: 90, center: [0]}, moves: [a, b]}\n",
            true,
        ),
        ("  - animate: {frames: 3, vti: a.vti, move: {to: [1]}, scan: [0, 1], moves: eye, rate: 12.5}\n", true),
        ("  - animate: {vti: a.vti, scan: [0, 1]}\n", false),
        ("  - animate: {frames: 3, vti: a.vti, turn: {from: 0}}\n", false),
        ("  - mesh: {vtu: a.vtu, arrays: [normal]}\n", false),
        ("  - render: {dimensions: [1, 2], occlusion: screen_space}\n", true),
        ("  - render: {dimensions: [1, 2], screen_space: {slices: 8, steps: 4, thickness: auto}}\n", true),
        ("  - render: {dimensions: [1, 2], screen_space: {thickness: unlimited, max_distance: 2}}\n", true),
        ("  - render: {dimensions: [1, 2], screen_space: {thickness: 0.5}}\n", true),
        ("  - render: {dimensions: [1, 2], screen_space: {thickness: thin}}\n", false),
        ("  - render: {dimensions: [1, 2], screen_space: 32}\n", false),
        ("  - shade: {image: a.vti, vti: b.vti, dimension: 3, camera: {eye: [0, 0, 1]}}\n", true),
        ("  - shade: {image: a.vti, vti: b.vti, depth: z, normal: n, screen_space: {}}\n", true),
        ("  - shade: {image: a.vti}\n", false),
        ("inputs: [b]\n", false),
        ("  - paraview: {state: a.py, cut: {plane: w}}\n", false),
        ("  - paraview: {state: a.py, cut: halves}\n", false),
        ("  - occlusion: {sampels: 4}\n", false),
        ("  - occlusion: {samples: many}\n", false),
        ("  - render: {}\n", false),
        ("  - render: {dimensions: [1, 2, 3], shading: smoth}\n", false),
        ("  - {render: {dimensions: [1, 2, 3]}, write: {vti: a.vti}}\n", false),
        ("  - shadow: {}\n", false),
    ] {
        let document = Document::parse("p.yaml", &format!("{scene}{stage}")).unwrap();
        let decoded = document.decode::<ao4d::pipeline::spec::PipelineSpec>();
        assert_eq!(decoded.is_ok(), right, "decoder, {stage}: {decoded:?}");
        assert_eq!(schema.accepts(&document).is_ok(), right, "schema, {stage}: {:?}", schema.accepts(&document));
    }
}
