//! The shipped pipelines and what they read, as they are in `pipelines/`.

/// Each by its name, with its text.
pub const PIPELINES: &[(&str, &str)] = &[
    ("ant", include_str!("../../../pipelines/ant.yaml")),
    ("bounce", include_str!("../../../pipelines/bounce.yaml")),
    ("droplet", include_str!("../../../pipelines/droplet.yaml")),
    ("gyroid", include_str!("../../../pipelines/gyroid.yaml")),
    ("gyroid_3d", include_str!("../../../pipelines/gyroid_3d.yaml")),
    ("layers", include_str!("../../../pipelines/layers.yaml")),
    ("lights", include_str!("../../../pipelines/lights.yaml")),
    ("moving_nut", include_str!("../../../pipelines/moving_nut.yaml")),
    ("nut", include_str!("../../../pipelines/nut.yaml")),
    ("peels", include_str!("../../../pipelines/peels.yaml")),
    ("polytopes", include_str!("../../../pipelines/polytopes.yaml")),
    ("products", include_str!("../../../pipelines/products.yaml")),
    ("screen_space", include_str!("../../../pipelines/screen_space.yaml")),
    ("slices", include_str!("../../../pipelines/slices.yaml")),
    ("spun_nut", include_str!("../../../pipelines/spun_nut.yaml")),
    ("thick_slices", include_str!("../../../pipelines/thick_slices.yaml")),
    ("tiger", include_str!("../../../pipelines/tiger.yaml")),
    ("tori", include_str!("../../../pipelines/tori.yaml")),
    ("two_cut_cubes", include_str!("../../../pipelines/two_cut_cubes.yaml")),
    ("two_tetrahedra", include_str!("../../../pipelines/two_tetrahedra.yaml")),
    ("lessons/01_axes", include_str!("../../../pipelines/lessons/01_axes.yaml")),
    ("lessons/02_cube", include_str!("../../../pipelines/lessons/02_cube.yaml")),
    ("lessons/03_turn", include_str!("../../../pipelines/lessons/03_turn.yaml")),
    ("lessons/04_sphere", include_str!("../../../pipelines/lessons/04_sphere.yaml")),
    ("lessons/05_groove", include_str!("../../../pipelines/lessons/05_groove.yaml")),
    ("lessons/06_scan", include_str!("../../../pipelines/lessons/06_scan.yaml")),
    ("lessons/07_polytopes", include_str!("../../../pipelines/lessons/07_polytopes.yaml")),
    ("lessons/08_ant", include_str!("../../../pipelines/lessons/08_ant.yaml")),
    ("lessons/09_torus", include_str!("../../../pipelines/lessons/09_torus.yaml")),
    ("lessons/10_tiger", include_str!("../../../pipelines/lessons/10_tiger.yaml")),
    ("thesis/fig_2_3", include_str!("../../../pipelines/thesis/fig_2_3.yaml")),
    ("thesis/fig_5_1", include_str!("../../../pipelines/thesis/fig_5_1.yaml")),
    ("thesis/fig_5_2", include_str!("../../../pipelines/thesis/fig_5_2.yaml")),
    ("thesis/fig_5_3", include_str!("../../../pipelines/thesis/fig_5_3.yaml")),
    ("thesis/fig_5_4", include_str!("../../../pipelines/thesis/fig_5_4.yaml")),
    ("thesis/fig_5_5", include_str!("../../../pipelines/thesis/fig_5_5.yaml")),
    ("thesis/fig_5_7", include_str!("../../../pipelines/thesis/fig_5_7.yaml")),
    ("thesis/fig_5_9", include_str!("../../../pipelines/thesis/fig_5_9.yaml")),
];

/// The files that they read, with what says where those are from.
pub const DATA: &[(&str, &[u8])] = &[
    ("data/LICENSE-napari-stress.txt", include_bytes!("../../../pipelines/data/LICENSE-napari-stress.txt")),
    ("data/README.md", include_bytes!("../../../pipelines/data/README.md")),
    ("data/droplet.tif", include_bytes!("../../../pipelines/data/droplet.tif")),
    ("meshes/LICENSE-pyvista.txt", include_bytes!("../../../pipelines/meshes/LICENSE-pyvista.txt")),
    ("meshes/README.md", include_bytes!("../../../pipelines/meshes/README.md")),
    ("meshes/ant.ply", include_bytes!("../../../pipelines/meshes/ant.ply")),
    ("meshes/nut.vtu", include_bytes!("../../../pipelines/meshes/nut.vtu")),
];

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;
    use std::path::Path;

    use super::*;

    fn files(folder: &Path, below: &str, found: &mut BTreeSet<String>) {
        for entry in std::fs::read_dir(folder).unwrap() {
            let entry = entry.unwrap();
            let name = format!("{below}{}", entry.file_name().to_str().unwrap());
            match entry.file_type().unwrap().is_dir() {
                true => files(&entry.path(), &format!("{name}/"), found),
                false => drop(found.insert(name)),
            }
        }
    }

    #[test]
    fn nothing_is_left_out() {
        let mut there = BTreeSet::new();
        files(&Path::new(env!("CARGO_MANIFEST_DIR")).join("pipelines"), "", &mut there);
        there.retain(|name| !name.starts_with("studies/") && !name.ends_with(".sh"));
        let pipelines = PIPELINES.iter().map(|(name, _)| format!("{name}.yaml"));
        let held: BTreeSet<String> = pipelines.chain(DATA.iter().map(|(name, _)| (*name).to_owned())).collect();
        assert_eq!(held, there);
    }
}
