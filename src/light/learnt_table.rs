//! Probabilities of bins of light at a place, learnt before a render [Vevoda, Kondapaneni, Krivanek, "Bayesian Online
//! Regression for Adaptive Direct Illumination Sampling", 2018]. Bins are parts of the sky, or clusters of lights.
//!
//! A tree divides the receivers by the side that their normals face and by position. Each of its cells has a probability
//! for each bin: [`LEARNT_SHARE`] is proportional to the root of the second moment of the light samples in the bin, whose
//! minimum variance that is, and which includes visibility; the rest is the sampling without the table, so that weights
//! stay bounded. A cell whose samples promise no gain is dropped, and so is the table if no cell is left.

use super::receiver::Receiver;
use crate::math::Vec3;
use std::array::from_fn;

/// Share of the learnt probabilities in the sampling of a cell.
pub const LEARNT_SHARE: f32 = 0.9;
/// Number of samples that the estimate of the cell's parent counts as; at the root, that the prior alone counts as.
const PRIOR_SAMPLES: f32 = 256.0;
/// Number of receivers up to which a cell is not divided.
const MAX_RECEIVERS: usize = 128;
/// Levels of the tree, which equal positions end.
const MAX_DEPTH: u32 = 40;
/// Largest second moment of light samples in a cell, over that without the table, for the cell to be used, and of all
/// cells together for the table to be used. A look-up takes a twentieth of the time of a path.
const MAX_RATIO: f64 = 0.8;
/// Largest ratio of a trial, which is larger, because few samples show less of the gain.
const MAX_TRIAL_RATIO: f64 = 0.9;
/// Sides that normals face: along the three axes and against them, and none.
const SIDES: usize = 7;
/// Index of a cell that is not used.
const NONE: u32 = u32::MAX;
/// Stands for the axis of a node that is not divided.
const LEAF: u32 = 3;
/// Two halves of the samples, each of which tests what the other has learnt, and all of them.
const PARTS: usize = 3;

/// A light sample that was not blocked.
#[derive(Clone, Copy, Debug)]
pub struct LitSample {
    /// The bin of the light.
    pub bin: usize,
    /// Light that the receiver scatters, over the density of the sample.
    pub value: f32,
    /// Densities over that of the sample: of finding the light by a bounce, and of sampling it in its bin alone.
    pub bounce: f32,
    pub within: f32,
}

/// A receiver whose light was sampled.
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

/// Light samples without a table, from which one is learnt.
#[derive(Default)]
pub struct LightSamples {
    receivers: Vec<LitReceiver>,
    lit: Vec<LitSample>,
}

impl LightSamples {
    /// Begins the `samples` samples of a receiver. `weight`: the square of the factor by which its light adds to the
    /// picture. Receivers of the same path belong to one `half`, 0 or 1.
    pub fn begin(&mut self, at: &Receiver, weight: f32, half: usize, samples: u32) {
        let (side, samples, first) = (side(at.n), samples as f32, self.lit.len());
        self.receivers.push(LitReceiver { p: at.p, side, weight, half, samples, first });
    }

    /// Adds a sample of the receiver that was begun last.
    pub fn add(&mut self, sample: LitSample) {
        let LitSample { value, bounce, within, .. } = sample;
        if value > 0.0 && within > 0.0 && [value, bounce, within].iter().all(|x| x.is_finite()) {
            self.lit.push(sample);
        }
    }

    /// Appends other samples.
    pub fn append(&mut self, other: LightSamples) {
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

/// Probabilities of the bins for the receivers of a leaf of the tree. Bins are arranged in rows, so that few numbers are
/// read to select one.
#[repr(align(64))]
pub struct Cell<const ROWS: usize, const COLUMNS: usize> {
    /// Probability of each row.
    rows: [f32; ROWS],
    /// Box within which the cell is used: that of its receivers, widened.
    low: Vec3,
    high: Vec3,
    /// Probability of each bin.
    bins: [[f32; COLUMNS]; ROWS],
}

impl<const ROWS: usize, const COLUMNS: usize> Cell<ROWS, COLUMNS> {
    /// Selects a bin by uniform numbers from 0 to 1, one for the row and one for the column. Returns it with the positions
    /// of the numbers in the intervals of row and column, from 0 to 1.
    #[inline]
    pub fn select(&self, y: f64, x: impl FnOnce(f64) -> f64) -> Option<(usize, [f64; 2])> {
        let (row, y) = select(&self.rows, y)?;
        let (column, x) = select(&self.bins[row], x(y) * f64::from(self.rows[row]))?;
        Some((row * COLUMNS + column, [y, x]))
    }

    /// Density of a light sample, from that of sampling the light in its bin alone, and that without the table.
    #[inline]
    pub fn density(&self, bin: usize, within: f32, without: f32) -> f32 {
        LEARNT_SHARE * self.bins.as_flattened()[bin] * within + (1.0 - LEARNT_SHARE) * without
    }
}

/// Selects an index in proportion to weights, where `target` is uniform from 0 to their sum. Returns it with the position
/// of the target in its interval, from 0 to 1.
#[inline]
fn select(weights: &[f32], target: f64) -> Option<(usize, f64)> {
    let (mut before, mut last) = (0.0, None);
    for (index, &weight) in weights.iter().enumerate() {
        let weight = f64::from(weight);
        if target < before + weight {
            return Some((index, ((target - before) / weight).clamp(0.0, 1.0f64.next_down())));
        }
        before += weight;
        last = if weight > 0.0 { Some((index, 1.0f64.next_down())) } else { last };
    }
    last
}

/// Learnt probabilities of `ROWS` x `COLUMNS` bins, by receiver. See the module.
pub struct LearntTable<const ROWS: usize, const COLUMNS: usize> {
    /// For each side, the root of its tree; [`NONE`] for sides without receivers.
    roots: [u32; SIDES],
    nodes: Vec<Node>,
    cells: Vec<Cell<ROWS, COLUMNS>>,
}

/// Estimates by part of the samples, for each bin, of the second moment of its light samples if they were all in the bin.
type Moments<const ROWS: usize, const COLUMNS: usize> = [[[f32; COLUMNS]; ROWS]; PARTS];

/// Builds the tree of one side.
struct Builder<'a, const ROWS: usize, const COLUMNS: usize> {
    samples: &'a LightSamples,
    /// Probability of each bin, if nothing is known about the receiver.
    prior: &'a [f32],
    /// Cells with a larger ratio of second moments are not used.
    max_ratio: f64,
    table: LearntTable<ROWS, COLUMNS>,
    /// Sums of the expected second moments without the table and with it.
    without: f64,
    learnt: f64,
}

impl<const ROWS: usize, const COLUMNS: usize> LearntTable<ROWS, COLUMNS> {
    /// Learns from light samples; `None` if the table would not reduce the noise. `prior`: for each bin, its probability
    /// if nothing is known about the receiver. Bins without probability are never selected.
    pub fn learn(samples: &LightSamples, prior: &[f32]) -> Option<LearntTable<ROWS, COLUMNS>> {
        LearntTable::build(samples, prior, MAX_RATIO)
    }

    /// Whether samples of a trial promise that a table reduces the noise.
    pub fn promise(samples: &LightSamples, prior: &[f32]) -> bool {
        LearntTable::<ROWS, COLUMNS>::build(samples, prior, MAX_TRIAL_RATIO).is_some()
    }

    /// The table; `None` if the expected second moment with it, over that without, is not below `max_ratio`.
    fn build(samples: &LightSamples, prior: &[f32], max_ratio: f64) -> Option<LearntTable<ROWS, COLUMNS>> {
        let table = LearntTable { roots: [NONE; SIDES], nodes: Vec::new(), cells: Vec::new() };
        let mut builder = Builder { samples, prior, max_ratio, table, without: 0.0, learnt: 0.0 };
        for side in 0..SIDES {
            let of_side = |&i: &u32| samples.receivers[i as usize].side == side;
            let mut order: Vec<u32> = (0..samples.receivers.len() as u32).filter(of_side).collect();
            if !order.is_empty() {
                let root = builder.add_node();
                builder.table.roots[side] = root as u32;
                let prior = builder.prior(&order);
                builder.build(root, &mut order, &prior, 0);
            }
        }
        (builder.learnt < max_ratio * builder.without).then_some(builder.table)
    }

    /// The cell of a receiver; `None` where the table knows nothing.
    #[inline]
    pub fn cell(&self, at: &Receiver) -> Option<&Cell<ROWS, COLUMNS>> {
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
}

impl<const ROWS: usize, const COLUMNS: usize> Builder<'_, ROWS, COLUMNS> {
    fn add_node(&mut self) -> usize {
        self.table.nodes.push(Node { at: 0.0, axis: LEAF, next: NONE });
        self.table.nodes.len() - 1
    }

    /// The moments that the prior alone suggests, as if the mean light came from all bins.
    fn prior(&self, order: &[u32]) -> Moments<ROWS, COLUMNS> {
        let lit = order.iter().flat_map(|&i| self.samples.lit(i));
        let sum: f32 = lit.map(|sample| sample.value / (1.0 + sample.bounce)).sum();
        let mean = sum / order.iter().map(|&i| self.samples.receivers[i as usize].samples).sum::<f32>();
        [from_fn(|row| from_fn(|column| (mean * self.prior[row * COLUMNS + column]).powi(2))); PARTS]
    }

    /// Builds the tree below a node, whose receivers are those of `order`. `before`: the estimates of its parent.
    fn build(&mut self, node: usize, order: &mut [u32], before: &Moments<ROWS, COLUMNS>, depth: u32) {
        let (mut moments, mut counts): (Moments<ROWS, COLUMNS>, _) = ([[[0.0; COLUMNS]; ROWS]; PARTS], [0.0; PARTS]);
        for &i in order.iter() {
            let receiver = &self.samples.receivers[i as usize];
            for part in [receiver.half, PARTS - 1] {
                counts[part] += receiver.samples;
                for sample in self.samples.lit(i) {
                    moments[part].as_flattened_mut()[sample.bin] +=
                        (sample.value / (1.0 + sample.bounce)).powi(2) / sample.within;
                }
            }
        }
        for ((own, before), count) in moments.iter_mut().zip(before).zip(counts) {
            for (own, before) in own.as_flattened_mut().iter_mut().zip(before.as_flattened()) {
                *own = (*own + PRIOR_SAMPLES * before) / (count + PRIOR_SAMPLES);
            }
        }
        let points = || order.iter().map(|&i| self.samples.receivers[i as usize].p);
        let low = points().fold(Vec3::INFINITY, Vec3::min);
        let high = points().fold(Vec3::NEG_INFINITY, Vec3::max);
        let axis = (high - low).max_position();
        let at = 0.5 * (low + high)[axis];
        if order.len() <= MAX_RECEIVERS || depth == MAX_DEPTH || !(low[axis] < at && at <= high[axis]) {
            self.table.nodes[node].next = self.add_cell(order, &moments, [low, high]);
            return;
        }
        let (above, below): (Vec<u32>, Vec<u32>) =
            order.iter().partition(|&&i| self.samples.receivers[i as usize].p[axis] >= at);
        let (first, second) = order.split_at_mut(below.len());
        first.copy_from_slice(&below);
        second.copy_from_slice(&above);
        let next = self.add_node();
        self.add_node();
        self.table.nodes[node] = Node { at, axis: axis as u32, next: next as u32 };
        self.build(next, first, &moments, depth + 1);
        self.build(next + 1, second, &moments, depth + 1);
    }

    /// Adds the cell of a leaf and returns its index; [`NONE`] if it would not reduce the noise.
    fn add_cell(&mut self, order: &[u32], moments: &Moments<ROWS, COLUMNS>, [low, high]: [Vec3; 2]) -> u32 {
        let wider = Vec3::splat(0.5 * low.distance(high));
        let cells = moments.each_ref().map(|moments| self.cell(moments, [low - wider, high + wider]));
        let (mut without, mut learnt) = (0.0, 0.0);
        for &i in order {
            let LitReceiver { weight, half, .. } = self.samples.receivers[i as usize];
            for sample in self.samples.lit(i) {
                let square = weight * sample.value * sample.value;
                without += f64::from(square / (1.0 + sample.bounce));
                let density = cells[1 - half].density(sample.bin, sample.within, 1.0);
                learnt += f64::from(square / (density + sample.bounce));
            }
        }
        self.without += without;
        let [.., cell] = cells;
        if learnt < self.max_ratio * without {
            self.learnt += learnt;
            self.table.cells.push(cell);
            self.table.cells.len() as u32 - 1
        } else {
            self.learnt += without;
            NONE
        }
    }

    /// The sampling that follows from the second moments of the bins.
    fn cell(&self, moments: &[[f32; COLUMNS]; ROWS], [low, high]: [Vec3; 2]) -> Cell<ROWS, COLUMNS> {
        let possible = |k: usize| self.prior[k] > 0.0;
        let weight = |k: usize| if possible(k) { moments.as_flattened()[k].sqrt() } else { 0.0 };
        let sum: f32 = (0..ROWS * COLUMNS).map(weight).sum();
        let probability = |k: usize| if sum > 0.0 { weight(k) / sum } else { self.prior[k] };
        let bins = from_fn(|row| from_fn(|column| probability(row * COLUMNS + column)));
        Cell { rows: bins.map(|row| row.iter().sum()), low, high, bins }
    }
}
