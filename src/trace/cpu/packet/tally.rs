//! How much the packet tracer visits, for those who measure it.

/// Is told what rays go through. Nobody listens to `()`, and what tells it costs nothing.
pub(super) trait Tally {
    /// So many rays start.
    fn rays(&mut self, _count: u32) {}
    /// A set of so many rays is at a node.
    fn set_at_node(&mut self, _rays: u32) {}
    /// A set of so many rays is at a leaf.
    fn set_at_leaf(&mut self, _rays: u32) {}
    /// A single ray is at a node.
    fn ray_at_node(&mut self) {}
    /// A single ray is at a leaf.
    fn ray_at_leaf(&mut self) {}
    /// What a single ray hits of a leaf is told by narrower bounds.
    fn ray_in_doubt(&mut self) {}
}

impl Tally for () {}

/// Counts of what rays went through; divided by `rays` they are what the mean ray takes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Visits {
    /// Rays that started: those that a vertex' own simplices hide don't.
    pub rays: u64,
    /// Nodes that sets of rays were at.
    pub set_nodes: u64,
    /// The rays of these sets.
    pub set_node_rays: u64,
    /// Leaves that sets of rays were at.
    pub set_leaves: u64,
    /// The rays of these sets.
    pub set_leaf_rays: u64,
    /// Nodes that single rays were at.
    pub single_nodes: u64,
    /// Leaves that single rays were at.
    pub single_leaves: u64,
    /// Of these, those with a simplex that took narrower bounds to tell.
    pub doubts: u64,
}

impl Tally for Visits {
    fn rays(&mut self, count: u32) {
        self.rays += u64::from(count);
    }

    fn set_at_node(&mut self, rays: u32) {
        self.set_nodes += 1;
        self.set_node_rays += u64::from(rays);
    }

    fn set_at_leaf(&mut self, rays: u32) {
        self.set_leaves += 1;
        self.set_leaf_rays += u64::from(rays);
    }

    fn ray_at_node(&mut self) {
        self.single_nodes += 1;
    }

    fn ray_at_leaf(&mut self) {
        self.single_leaves += 1;
    }

    fn ray_in_doubt(&mut self) {
        self.doubts += 1;
    }
}
