//! Where the numbers of a network's layers lie in one flat vector, what they are called, and how they start.
//!
//! One vector makes steps, sums over a batch, checkpoints and files the same for every layer.

use rand::{RngExt as _, rngs::StdRng};
use rand_distr::{Distribution as _, Normal};

/// How a tensor starts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Start {
    Zero,
    One,
    /// Evenly within +- this.
    Uniform(f32),
    /// Normal with this deviation.
    Normal(f32),
}

/// One tensor.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Place {
    pub(crate) name: String,
    pub(crate) shape: Vec<usize>,
    pub(crate) offset: usize,
    pub(crate) start: Start,
}

impl Place {
    pub(crate) fn len(&self) -> usize {
        self.shape.iter().product()
    }
}

/// All tensors of a network, in the order of the flat vector.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Layout {
    pub(crate) places: Vec<Place>,
    pub(crate) count: usize,
}

impl Layout {
    /// Makes room for a tensor; its offset.
    pub(crate) fn add(&mut self, name: String, shape: Vec<usize>, start: Start) -> usize {
        let place = Place { name, shape, offset: self.count, start };
        self.count += place.len();
        self.places.push(place);
        self.places[self.places.len() - 1].offset
    }

    /// Fresh numbers for all tensors.
    pub(crate) fn init(&self, rng: &mut StdRng) -> Vec<f32> {
        let mut numbers = vec![0.0; self.count];
        for place in &self.places {
            let own = &mut numbers[place.offset..][..place.len()];
            match place.start {
                Start::Zero => {}
                Start::One => own.fill(1.0),
                Start::Uniform(bound) => own.fill_with(|| rng.random_range(-bound..bound)),
                Start::Normal(deviation) => {
                    let normal = Normal::new(0.0, deviation).expect("a positive deviation");
                    own.fill_with(|| normal.sample(rng));
                }
            }
        }
        numbers
    }
}
