//! What the axes of an image are, where its points lie, and how a file's axes become x, y, z and time.
//!
//! A file keeps its axes in some order, the fastest first, and says of each by name, kind or attribute what it is; or it does
//! not, and then the format's custom counts, or the key `axes`. Each axis runs along a direction of the world, so that a body
//! lies where other programs put it.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::numbers::{Numbers, arrange};
use super::{Request, counted};

/// What an axis is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
#[allow(missing_docs)]
pub enum Role {
    X,
    Y,
    Z,
    Time,
    /// Several values at each point: colours, components, bands.
    Channel,
}

impl Role {
    /// x, y, z and time.
    pub const GRID: [Role; 4] = [Role::X, Role::Y, Role::Z, Role::Time];

    /// What it is called in a pipeline.
    pub fn name(self) -> &'static str {
        match self {
            Role::X => "x",
            Role::Y => "y",
            Role::Z => "z",
            Role::Time => "time",
            Role::Channel => "channel",
        }
    }

    /// The role that a name says, in any of the formats.
    pub fn of_name(name: &str) -> Option<Self> {
        let name = name.trim().to_lowercase();
        Some(match name.as_str() {
            "x"
            | "lon"
            | "longitude"
            | "easting"
            | "xc"
            | "nx"
            | "rlon"
            | "west_east"
            | "west_east_stag"
            | "projection_x_coordinate"
            | "grid_longitude" => Role::X,
            "y"
            | "lat"
            | "latitude"
            | "northing"
            | "yc"
            | "ny"
            | "rlat"
            | "south_north"
            | "south_north_stag"
            | "projection_y_coordinate"
            | "grid_latitude" => Role::Y,
            "z" | "lev" | "level" | "levels" | "depth" | "height" | "altitude" | "plev" | "elevation" | "zc" | "nz"
            | "slice" | "slices" | "air_pressure" | "bottom_top" | "bottom_top_stag" => Role::Z,
            "t" | "time" | "times" | "frame" | "frames" | "nt" | "timepoint" | "date" | "step" => Role::Time,
            "c" | "s" | "channel" | "channels" | "component" | "components" | "band" | "bands" | "wavelength"
            | "sample" | "samples" | "member" | "ensemble" | "realization" => Role::Channel,
            _ => return None,
        })
    }
}

/// Where the points of an axis are, along its direction.
#[derive(Clone, Debug, PartialEq)]
pub enum Positions {
    /// At the same distance from each other.
    Even {
        /// The first.
        start: f64,
        /// The distance.
        step: f64,
    },
    /// One by one.
    Listed(Vec<f64>),
}

impl Positions {
    /// The first at 0, and so on in steps of 1.
    pub const INDICES: Self = Positions::Even { start: 0.0, step: 1.0 };

    /// Evenly spaced from 0; a distance that is no use counts as 1.
    pub fn spaced(step: f64) -> Self {
        Self::even(0.0, step)
    }

    /// Evenly spaced; a distance that is no use counts as 1.
    pub fn even(start: f64, step: f64) -> Self {
        let usable = step.is_finite() && step != 0.0 && start.is_finite();
        if usable { Positions::Even { start, step } } else { Self::INDICES }
    }

    /// Where point `i` is.
    pub fn at(&self, i: usize) -> f64 {
        match self {
            Positions::Even { start, step } => start + i as f64 * step,
            Positions::Listed(list) => list.get(i).copied().unwrap_or(f64::NAN),
        }
    }

    /// The distance from the first point to the second.
    pub fn step(&self) -> f64 {
        match self {
            Positions::Even { step, .. } => *step,
            Positions::Listed(list) => {
                if list.len() > 1 {
                    list[1] - list[0]
                } else {
                    1.0
                }
            }
        }
    }

    /// Each place times `factor`, plus `shift`.
    pub fn map(&mut self, factor: f64, shift: f64) {
        match self {
            Positions::Even { start, step } => {
                *start = *start * factor + shift;
                *step *= factor;
            }
            Positions::Listed(list) => list.iter_mut().for_each(|at| *at = *at * factor + shift),
        }
    }

    /// Whether they go up, or down, all the way.
    pub fn is_monotonic(&self) -> bool {
        match self {
            Positions::Even { .. } => true,
            Positions::Listed(list) => {
                let finite = list.iter().all(|at| at.is_finite());
                finite && (list.windows(2).all(|p| p[0] < p[1]) || list.windows(2).all(|p| p[0] > p[1]))
            }
        }
    }
}

/// An axis of a file.
#[derive(Clone, Debug, PartialEq)]
pub struct Axis {
    /// What the file calls it.
    pub name: String,
    /// What it is, if the file says so.
    pub role: Option<Role>,
    /// How many points there are along it.
    pub size: usize,
    /// Where they are.
    pub positions: Positions,
    /// In what.
    pub unit: Option<String>,
    /// The unit vector of the world that it runs along, if that isn't the one of its role.
    pub direction: Option<[f64; 4]>,
}

impl Axis {
    /// An axis whose points are counted from 0.
    pub fn new(name: impl Into<String>, role: Option<Role>, size: usize) -> Self {
        Self { name: name.into(), role, size, positions: Positions::INDICES, unit: None, direction: None }
    }

    /// The same in steps of another length; one that is no use counts as 1.
    pub fn spaced(mut self, step: f64) -> Self {
        self.positions = Positions::spaced(step);
        self
    }
}

/// Directions that are not those of x, y, z and time, and where they start.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    /// The unit vector of each axis.
    pub directions: [[f64; 4]; 4],
    /// Where the first point lies.
    pub origin: [f64; 4],
}

/// A file that has been opened, with its axes as they are stored.
pub struct Opened {
    /// What kind of file it is.
    pub format: &'static str,
    /// Its axes, the fastest first.
    pub axes: Vec<Axis>,
    /// Where the first point lies.
    pub origin: [f64; 4],
    /// Which way x, y and z point, where the file says so: `RAS` is to the right, to the front (anterior) and up (superior).
    pub space: Option<String>,
    /// The type of the numbers stored.
    pub number: String,
    /// What they measure.
    pub unit: Option<String>,
    /// Whether the places along time are in the file; they are counted otherwise.
    pub has_times: bool,
    /// The values, in the file's order.
    pub values: Box<dyn Numbers>,
    /// What is worth telling.
    pub notes: Vec<String>,
    /// How many axes may be channels without being asked for, with the first of them taken.
    pub first_channel: bool,
}

impl Opened {
    /// A file without a word about anything but its axes.
    pub fn new(format: &'static str, axes: Vec<Axis>, number: impl Into<String>, values: Box<dyn Numbers>) -> Self {
        Self {
            format,
            axes,
            origin: [0.0; 4],
            space: None,
            number: number.into(),
            unit: None,
            has_times: false,
            values,
            notes: Vec::new(),
            first_channel: false,
        }
    }

    /// The axes in words: `x (9), y (8), "band" (3)`.
    fn listed(&self) -> String {
        let one = |axis: &Axis| match axis.role {
            Some(role) if role.name() == axis.name => format!("{} ({})", axis.name, axis.size),
            Some(role) => format!("\"{}\" ({}, {})", axis.name, role.name(), axis.size),
            None => format!("\"{}\" ({})", axis.name, axis.size),
        };
        self.axes.iter().map(one).collect::<Vec<_>>().join(", ")
    }

    /// The role of each axis: as the request says, or the file.
    fn roles(&mut self, request: &Request) -> Result<Vec<Option<Role>>, String> {
        if let Some(asked) = &request.axes {
            if asked.len() != self.axes.len() {
                let (count, there) = (asked.len(), self.listed());
                return Err(format!(
                    "axes names {count} axes, and there are {}, the fastest first: {there}",
                    self.axes.len()
                ));
            }
            return Ok(asked.iter().copied().map(Some).collect());
        }
        let mut roles: Vec<Option<Role>> = self.axes.iter().map(|axis| axis.role).collect();
        // Where nothing is said at all the custom counts: x, y, z and time, the fastest first.
        if roles.len() <= 4 && roles.iter().all(Option::is_none) {
            roles = Role::GRID.iter().copied().map(Some).take(roles.len()).collect();
        }
        Ok(roles)
    }

    /// The image, with its axes in order.
    pub fn arrange(mut self, request: &Request) -> Result<Image, String> {
        if self.axes.iter().any(|axis| axis.size == 0) {
            return Err(format!("holds no point: its axes are {}", self.listed()));
        }
        let roles = self.roles(request)?;
        let mut places: [Option<usize>; 4] = [None; 4];
        let mut channels = Vec::new();
        for (i, role) in roles.iter().enumerate() {
            let axis = &self.axes[i];
            match role {
                _ if axis.size == 1 && role.is_none_or(|role| role == Role::Channel) => {}
                None => {
                    return Err(format!(
                        "its axis \"{}\" of {} points is none of x, y, z and time by its name or kind; \
                         say what each axis is by axes, the fastest first: they are {}",
                        axis.name,
                        axis.size,
                        self.listed()
                    ));
                }
                Some(Role::Channel) => channels.push(i),
                Some(role) => {
                    let place = &mut places[*role as usize];
                    if let Some(other) = place.filter(|&other| self.axes[other].size > 1 && axis.size > 1) {
                        return Err(format!(
                            "its axes \"{}\" and \"{}\" are both {}; say what each axis is by axes: they are {}",
                            self.axes[other].name,
                            axis.name,
                            role.name(),
                            self.listed()
                        ));
                    }
                    if place.is_none_or(|other| self.axes[other].size == 1) {
                        *place = Some(i);
                    }
                }
            }
        }
        let channel = match channels.as_slice() {
            [] if request.channel.unwrap_or(0) > 0 => {
                return Err(format!(
                    "has one channel, counted from 0; there is no channel {}",
                    request.channel.unwrap_or(0)
                ));
            }
            [] => None,
            &[axis] => Some((axis, self.channel(axis, request)?)),
            &[one, two, ..] => {
                return Err(format!(
                    "its axes \"{}\" and \"{}\" both hold several values a point; one such axis is understood: {}",
                    self.axes[one].name,
                    self.axes[two].name,
                    self.listed()
                ));
            }
        };
        let sizes: Vec<usize> = self.axes.iter().map(|axis| axis.size).collect();
        counted(&sizes, 1)?;
        let order: Vec<usize> = places.iter().flatten().copied().collect();
        let values = arrange(self.values, &sizes, &order, channel);
        let axes: [Axis; 4] = std::array::from_fn(|i| match places[i] {
            Some(place) => self.axes[place].clone(),
            None => Axis::new(Role::GRID[i].name(), None, 1),
        });
        let image =
            Image { axes, frame: None, values, space: self.space, has_times: self.has_times, notes: self.notes };
        image.placed(self.origin, request)
    }

    /// Which channel is taken.
    fn channel(&mut self, axis: usize, request: &Request) -> Result<usize, String> {
        let Axis { name, size, .. } = &self.axes[axis];
        match request.channel {
            Some(channel) if channel >= *size => {
                Err(format!("has {size} channels, counted from 0; there is no channel {channel}"))
            }
            Some(channel) => Ok(channel),
            None if self.first_channel => {
                self.notes
                    .push(format!("channel: the first of {size} channels is taken ({name}); channel chooses another"));
                Ok(0)
            }
            None => Err(format!(
                "its axis \"{name}\" holds {size} values at each point; say which one by channel, from 0 to {}, or what \
                 each axis is by axes: they are {}",
                size - 1,
                self.listed()
            )),
        }
    }
}

/// An image with its axes in order: x, y, z, time.
pub struct Image {
    /// The axes.
    pub axes: [Axis; 4],
    /// Where they point, if they are not those of the world themselves; places along them are then from the first point on.
    pub frame: Option<Frame>,
    /// The values, x fastest, then y, z, time.
    pub values: Box<dyn Numbers>,
    /// Which way x, y and z point, as in [`Opened::space`].
    pub space: Option<String>,
    /// Whether the places along time are in the file.
    pub has_times: bool,
    /// What is worth telling.
    pub notes: Vec<String>,
}

impl Image {
    /// The points along each axis.
    pub fn points(&self) -> [usize; 4] {
        self.axes.each_ref().map(|axis| axis.size)
    }

    /// Puts the axes into the world, unless they are to stay as they are stored.
    fn placed(mut self, origin: [f64; 4], request: &Request) -> Result<Self, String> {
        if request.placement == Placement::Stored {
            for axis in &mut self.axes {
                if let Positions::Even { start, step } = &mut axis.positions {
                    (*start, *step) = (0.0, step.abs());
                }
                axis.direction = None;
            }
            return Ok(self);
        }
        let mut directions: [[f64; 4]; 4] = std::array::from_fn(|i| {
            self.axes[i].direction.unwrap_or(std::array::from_fn(|k| f64::from(u8::from(i == k))))
        });
        let mut origin = origin;
        if let Some(wanted) = &request.space {
            let signs = self.turn(wanted)?;
            for i in 0..3 {
                directions.iter_mut().for_each(|direction| direction[i] *= signs[i]);
                origin[i] *= signs[i];
            }
        }
        let straight = |i: usize| (0..4).all(|k| directions[i][k] == 0.0 || (k == i && directions[i][k].abs() == 1.0));
        if (0..4).all(straight) {
            (0..4).for_each(|i| self.axes[i].positions.map(directions[i][i], origin[i]));
            return Ok(self);
        }
        let determinant = nalgebra::Matrix4::from_fn(|row, column| directions[column][row]).determinant();
        if determinant.is_nan() || determinant.abs() <= 1e-9 {
            return Err("the directions of its axes lie in one plane; placement: stored does without them".into());
        }
        self.frame = Some(Frame { directions, origin });
        Ok(self)
    }

    /// The signs that turn x, y and z as asked for.
    fn turn(&self, wanted: &str) -> Result<[f64; 3], String> {
        let there =
            self.space.as_deref().ok_or("doesn't say which way its axes point, so that space can't turn them")?;
        let mut signs = [1.0; 3];
        for (i, (from, to)) in there.chars().zip(wanted.to_uppercase().chars()).enumerate() {
            let pair = |c: char| "RL AP SI".split(' ').position(|pair| pair.contains(c));
            if pair(from) != pair(to) {
                return Err(format!(
                    "its axes point {there}; space can turn them round, not exchange them as {wanted} would"
                ));
            }
            signs[i] = if from == to { 1.0 } else { -1.0 };
        }
        Ok(signs)
    }
}

/// Where an image is put.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Placement {
    /// Where the file says, by origin and direction.
    #[default]
    World,
    /// As it is stored: from 0 along x, y and z, by its spacings alone.
    Stored,
}
