//! What ParaView, VTK and other programs make of the files, and whole pipelines.

#[path = "../support/smaller.rs"]
mod smaller;

mod images_by_others;
mod paraview_run;
mod paraview_state;
mod pieces;
mod pipelines;
mod plugin;
mod vtk_files;
