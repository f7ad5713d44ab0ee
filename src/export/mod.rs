//! Files: images, meshes, pictures and ParaView states.

pub mod paraview;
