//! Directions of the environment from which light arrives at a place, learnt before a render [Vevoda, Kondapaneni,
//! Krivanek, "Bayesian Online Regression for Adaptive Direct Illumination Sampling", 2018].
//!
//! A tree divides the receivers by the side that their normals face and by position. Each of its cells has a probability
//! for each sector of the environment: 9/10 is proportional to the root of the second moment of the light samples in the
//! sector, whose minimum variance that is, and which includes visibility; 1/10 is the sampling of
//! [`Environment::sample_at`], so that weights stay bounded. Within a sector, the density is that of
//! [`Environment::sample`]. A cell whose samples promise no gain is dropped, and so is the table if no cell is left.

use super::environment::{Environment, EnvironmentSample, SECTOR_COLUMNS, SECTOR_ROWS, SECTORS, Sectors};
use super::receiver::Receiver;
use crate::math::{Frame, Rgb, Vec2, Vec3, warp};
use std::array::from_fn;
use std::f32::consts::FRAC_1_PI;

/// Share of the learnt probabilities in the sampling of a cell.
const LEARNT_SHARE: f32 = 0.9;
/// Number of samples that the estimate of the cell's parent counts as; at the root, that the image alone counts as.
const PRIOR_SAMPLES: f32 = 256.0;
/// Number of receivers up to which a cell is not divided.
const MAX_RECEIVERS: usize = 128;
/// Levels of the tree, which equal positions end.
const MAX_DEPTH: u32 = 40;
/// Largest second moment of light samples in a cell, over that without the table, for the cell to be used, and largest
/// ratio of all together for the table to be used. A look-up takes a twentieth of the time of a path.
const MAX_CELL_RATIO: f64 = 0.5;
const MAX_TABLE_RATIO: f64 = 0.8;
/// Sides that normals face: along the three axes and against them, and none.
const SIDES: usize = 7;
/// Index of a cell that is not used.
const NONE: u32 = u32::MAX;
/// Stands for the axis of a node that is not divided.
const LEAF: u32 = 3;
/// Two halves of the samples, each of which tests what the other has learnt, and all of them.
const PARTS: usize = 3;

/// A light sample of the environment that was not blocked.
struct LitSample {
    sector: usize,
    /// Light that the receiver scatters, over its density.
    value: f32,
    /// Densities over that of the sample: of finding the direction by a bounce, of the image, and of the cosine.
    bounce: f32,
    image: f32,
    cosine: f32,
}

/// A receiver whose environment was sampled.
struct LitReceiver {
    p: Vec3,
    side: usize,
    /// Weight of its squared light in the picture.
    weight: f32,
    /// The half of the samples, 0 or 1.
    half: usize,
    /// Number of samples, blocked ones included.
    samples: f32,
    /// Index of the first sample that was not blocked; the next receiver ends them.
    first: usize,
}

/// Light samples of the environment, from which a [`LearntSky`] learns.
#[derive(Default)]
pub struct SkySamples {
    receivers: Vec<LitReceiver>,
    lit: Vec<LitSample>,
}

impl SkySamples {
    /// Begins the `samples` samples of a receiver. `weight`: the square of the factor by which its light adds to the
    /// picture. Receivers of the same path belong to one `half`, 0 or 1.
    pub fn begin(&mut self, at: &Receiver, weight: f32, half: usize, samples: u32) {
        let (side, samples, first) = (side(at.n), samples as f32, self.lit.len());
        self.receivers.push(LitReceiver { p: at.p, side, weight, half, samples, first });
    }

    /// Adds a sample of the receiver that was begun last. `value`: the light that it scatters, over the density of the
    /// sample. `bounce`: density with which a bounce finds the direction, over that of the sample.
    pub fn add(&mut self, environment: &Environment, at: &Receiver, wi: Vec3, value: f32, bounce: f32) {
        let (_, image, sector) = environment.look_up(wi);
        let density = environment.pdf_w_at(at.n, wi, image);
        let [image, cosine] = [image, cosine_density(at.n, wi)].map(|pdf_w| pdf_w / density);
        if value > 0.0 && [value, bounce, image, cosine].iter().all(|x| x.is_finite()) && image > 0.0 {
            self.lit.push(LitSample { sector, value, bounce, image, cosine });
        }
    }

    /// Appends other samples.
    pub fn append(&mut self, other: SkySamples) {
        let before = self.lit.len();
        self.receivers.extend(other.receivers.into_iter().map(|of| LitReceiver { first: of.first + before, ..of }));
        self.lit.extend(other.lit);
    }

    fn lit(&self, receiver: u32) -> &[LitSample] {
        let next = self.receivers.get(receiver as usize + 1).map_or(self.lit.len(), |next| next.first);
        &self.lit[self.receivers[receiver as usize].first..next]
    }
}

/// The side that a normal faces.
#[inline]
fn side(n: Vec3) -> usize {
    if n == Vec3::ZERO {
        return SIDES - 1;
    }
    let axis = n.abs().max_position();
    2 * axis + usize::from(n[axis] < 0.0)
}

/// A node of the tree over positions.
#[derive(Clone, Copy)]
struct Node {
    /// The coordinate at which the node is divided.
    at: f32,
    /// The axis of the coordinate, or [`LEAF`].
    axis: u32,
    /// Index of the first of two children; of a leaf, the index of its cell or [`NONE`].
    next: u32,
}

/// Sampling of the environment for the receivers of a leaf of the tree.
#[repr(align(64))]
struct Cell {
    /// Probability of each row of sectors.
    rows: [f32; SECTOR_ROWS],
    /// Box within which the cell is used: that of its receivers, widened.
    low: Vec3,
    high: Vec3,
    /// Probability of sampling the cosine.
    cosine: f32,
    /// Probability of each sector.
    sectors: [[f32; SECTOR_COLUMNS]; SECTOR_ROWS],
}

/// A learnt distribution of directions towards the environment, by receiver. See the module.
pub struct LearntSky {
    environment: Environment,
    sectors: Sectors,
    /// For each side, the root of its tree; [`NONE`] for sides without receivers.
    roots: [u32; SIDES],
    nodes: Vec<Node>,
    cells: Vec<Cell>,
}

/// Estimates by part of the samples, for each sector, of the second moment of its light samples if they were all in the
/// sector.
type Moments = [[f32; SECTORS]; PARTS];

/// Builds the tree of one side.
struct Builder<'a> {
    samples: &'a SkySamples,
    sky: LearntSky,
    /// Share of the cosine without the table.
    share: f32,
    /// Sums of the expected second moments without the table and with it.
    today: f64,
    learnt: f64,
}

impl LearntSky {
    /// Learns from light samples; `None` if the table would not reduce the noise.
    pub fn learn(environment: &Environment, samples: &SkySamples) -> Option<LearntSky> {
        let sectors = environment.sectors();
        let (environment, roots) = (environment.clone(), [NONE; SIDES]);
        let sky = LearntSky { environment, sectors, roots, nodes: Vec::new(), cells: Vec::new() };
        let mut builder = Builder { samples, sky, share: 0.0, today: 0.0, learnt: 0.0 };
        for side in 0..SIDES {
            let of_side = |&i: &u32| samples.receivers[i as usize].side == side;
            let mut order: Vec<u32> = (0..samples.receivers.len() as u32).filter(of_side).collect();
            if !order.is_empty() {
                builder.share = if side == SIDES - 1 { 0.0 } else { builder.sky.environment.cosine_share() };
                let root = builder.add_node();
                builder.sky.roots[side] = root as u32;
                let prior = builder.prior(&order);
                builder.build(root, &mut order, &prior, 0);
            }
        }
        (builder.learnt < MAX_TABLE_RATIO * builder.today).then_some(builder.sky)
    }

    /// Whether the table was learnt under this environment, whose light it returns.
    pub fn is_of(&self, environment: &Environment) -> bool {
        match (&self.environment, environment) {
            (Environment::Uniform(own), Environment::Uniform(other)) => own == other,
            (Environment::Image(own), Environment::Image(other)) => std::sync::Arc::ptr_eq(own, other),
            _ => false,
        }
    }

    /// The cell of a receiver; `None` where the table knows nothing.
    #[inline]
    fn cell(&self, at: &Receiver) -> Option<&Cell> {
        let mut index = self.roots[side(at.n)];
        if at.in_medium || index == NONE {
            return None;
        }
        loop {
            let node = &self.nodes[index as usize];
            if node.axis == LEAF {
                let cell = self.cells.get(node.next as usize)?;
                return (at.p.cmpge(cell.low).all() && at.p.cmple(cell.high).all()).then_some(cell);
            }
            index = node.next + u32::from(at.p[node.axis as usize] >= node.at);
        }
    }

    /// Samples a direction for a receiver by the uniform point `u`, and returns it with its density. The sample itself
    /// holds the density of [`Environment::sample`].
    #[inline]
    pub fn sample(&self, at: &Receiver, u: Vec2) -> Option<(EnvironmentSample, f32)> {
        let Some(cell) = self.cell(at) else { return self.environment.sample_with_density_at(at.n, u) };
        let (sample, sector) = if u.x < cell.cosine {
            let wi = warp::hemisphere_cosine(Vec2::new(u.x / cell.cosine, u.y));
            let wi = Frame::from_normal(at.n).to_world(wi);
            let (radiance, pdf_w, sector) = self.environment.look_up(wi);
            (EnvironmentSample { wi, pdf_w, radiance }, sector)
        } else {
            let (row, y) = select(&cell.rows, u.x - cell.cosine)?;
            let (column, x) = select(&cell.sectors[row], u.y * cell.rows[row])?;
            let sector = row * SECTOR_COLUMNS + column;
            (self.environment.sample_sector(&self.sectors, sector, Vec2::new(y, x))?, sector)
        };
        let density = cell.density(&self.sectors, sector, sample.pdf_w, cosine_density(at.n, sample.wi));
        Some((sample, density))
    }

    /// Light from a direction, the density with which [`LearntSky::sample`] samples it for a receiver, and the density of
    /// [`Environment::sample`].
    #[inline]
    pub fn arriving(&self, at: &Receiver, d: Vec3) -> (Rgb, f32, f32) {
        let (radiance, image, sector) = self.environment.look_up(d);
        let pdf_w = match self.cell(at) {
            None => self.environment.pdf_w_at(at.n, d, image),
            Some(cell) => cell.density(&self.sectors, sector, image, cosine_density(at.n, d)),
        };
        (radiance, pdf_w, image)
    }
}

/// Density per solid angle of a direction that is sampled in proportion to its cosine.
#[inline]
fn cosine_density(n: Vec3, d: Vec3) -> f32 {
    d.dot(n).max(0.0) * FRAC_1_PI
}

impl Cell {
    /// Density with which the cell samples a direction of a sector, from the densities of [`Environment::sample`] and of
    /// the cosine.
    #[inline]
    fn density(&self, sectors: &Sectors, sector: usize, image: f32, cosine: f32) -> f32 {
        let probability = sectors.probabilities[sector];
        let learnt = if probability > 0.0 { self.sectors.as_flattened()[sector] / probability } else { 0.0 };
        learnt * image + self.cosine * cosine
    }
}

/// Selects an index in proportion to weights, where `target` is uniform from 0 to their sum. Returns it with the position
/// of the target in its interval, from 0 to 1.
#[inline]
fn select(weights: &[f32], target: f32) -> Option<(usize, f32)> {
    let (mut before, mut last) = (0.0, None);
    for (index, &weight) in weights.iter().enumerate() {
        if target < before + weight {
            return Some((index, ((target - before) / weight).clamp(0.0, 1.0f32.next_down())));
        }
        before += weight;
        last = if weight > 0.0 { Some((index, 1.0f32.next_down())) } else { last };
    }
    last
}

impl Builder<'_> {
    fn add_node(&mut self) -> usize {
        self.sky.nodes.push(Node { at: 0.0, axis: LEAF, next: NONE });
        self.sky.nodes.len() - 1
    }

    /// The moments that the environment alone suggests, as if its mean light came from all directions.
    fn prior(&self, order: &[u32]) -> Moments {
        let lit = order.iter().flat_map(|&i| self.samples.lit(i));
        let sum: f32 = lit.map(|sample| sample.value / (1.0 + sample.bounce)).sum();
        let mean = sum / order.iter().map(|&i| self.samples.receivers[i as usize].samples).sum::<f32>();
        [from_fn(|k| (mean * self.sky.sectors.probabilities[k]).powi(2)); PARTS]
    }

    /// Builds the tree below a node, whose receivers are those of `order`. `before`: the estimates of its parent.
    fn build(&mut self, node: usize, order: &mut [u32], before: &Moments, depth: u32) {
        let (mut sums, mut counts) = ([[0.0; SECTORS]; PARTS], [0.0; PARTS]);
        for &i in order.iter() {
            let receiver = &self.samples.receivers[i as usize];
            for part in [receiver.half, PARTS - 1] {
                counts[part] += receiver.samples;
                for sample in self.samples.lit(i) {
                    let within = self.sky.sectors.probabilities[sample.sector] / sample.image;
                    sums[part][sample.sector] += (sample.value / (1.0 + sample.bounce)).powi(2) * within;
                }
            }
        }
        let estimate =
            |part: usize, k: usize| (sums[part][k] + PRIOR_SAMPLES * before[part][k]) / (counts[part] + PRIOR_SAMPLES);
        let moments: Moments = from_fn(|part| from_fn(|k| estimate(part, k)));
        let points = || order.iter().map(|&i| self.samples.receivers[i as usize].p);
        let low = points().fold(Vec3::INFINITY, Vec3::min);
        let high = points().fold(Vec3::NEG_INFINITY, Vec3::max);
        let axis = (high - low).max_position();
        let at = 0.5 * (low + high)[axis];
        if order.len() <= MAX_RECEIVERS || depth == MAX_DEPTH || !(low[axis] < at && at <= high[axis]) {
            self.sky.nodes[node].next = self.add_cell(order, &moments, [low, high]);
            return;
        }
        let (above, below): (Vec<u32>, Vec<u32>) =
            order.iter().partition(|&&i| self.samples.receivers[i as usize].p[axis] >= at);
        let (first, second) = order.split_at_mut(below.len());
        first.copy_from_slice(&below);
        second.copy_from_slice(&above);
        let next = self.add_node();
        self.add_node();
        self.sky.nodes[node] = Node { at, axis: axis as u32, next: next as u32 };
        self.build(next, first, &moments, depth + 1);
        self.build(next + 1, second, &moments, depth + 1);
    }

    /// Adds the cell of a leaf and returns its index; [`NONE`] if it would not reduce the noise.
    fn add_cell(&mut self, order: &[u32], moments: &Moments, [low, high]: [Vec3; 2]) -> u32 {
        let wider = Vec3::splat(0.5 * low.distance(high));
        let cells = moments.each_ref().map(|moments| self.cell(moments, [low - wider, high + wider]));
        let (mut today, mut learnt) = (0.0, 0.0);
        for &i in order {
            let LitReceiver { weight, half, .. } = self.samples.receivers[i as usize];
            for sample in self.samples.lit(i) {
                let square = weight * sample.value * sample.value;
                today += f64::from(square / (1.0 + sample.bounce));
                let LitSample { sector, image, cosine, bounce, .. } = *sample;
                let density = cells[1 - half].density(&self.sky.sectors, sector, image, cosine);
                learnt += f64::from(square / (density + bounce));
            }
        }
        self.today += today;
        let [.., cell] = cells;
        if learnt < MAX_CELL_RATIO * today {
            self.learnt += learnt;
            self.sky.cells.push(cell);
            self.sky.cells.len() as u32 - 1
        } else {
            self.learnt += today;
            NONE
        }
    }

    /// The sampling that follows from the second moments of the sectors.
    fn cell(&self, moments: &[f32; SECTORS], [low, high]: [Vec3; 2]) -> Cell {
        let probabilities = &self.sky.sectors.probabilities;
        let weights: [f32; SECTORS] = from_fn(|k| if probabilities[k] > 0.0 { moments[k].sqrt() } else { 0.0 });
        let scale = LEARNT_SHARE / weights.iter().sum::<f32>();
        let scale = if scale.is_finite() { scale } else { 0.0 };
        let cosine = (1.0 - LEARNT_SHARE) * self.share;
        let rest = if scale > 0.0 { 1.0 - LEARNT_SHARE - cosine } else { 1.0 - cosine };
        let sectors: [[f32; SECTOR_COLUMNS]; SECTOR_ROWS] = from_fn(|row| {
            from_fn(|column| row * SECTOR_COLUMNS + column).map(|k| scale * weights[k] + rest * probabilities[k])
        });
        Cell { rows: sectors.map(|row| row.iter().sum()), low, high, cosine, sectors }
    }
}
