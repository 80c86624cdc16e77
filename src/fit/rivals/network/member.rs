//! One network of an ensemble: its first weights, its training with early stopping, and its value at an input.
//!
//! Two hidden layers of [`HIDDEN`] tanh units, all in f64. Training is on the whole set at once by `AdamW` on the mean squared error; the weights
//! that are kept are those with the least error on the validation set, and training ends when [`PATIENCE`] checks have not lowered it.
//! The CPU generator of the library takes no seed, so first weights come from a `ChaCha` stream of our own.

use candle_core::{Device, Result, Tensor, Var};
use candle_nn::{AdamW, Optimizer, ParamsAdamW};
use nalgebra::{DMatrix, RowDVector};
use rand_chacha::ChaCha12Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

/// Units of a hidden layer.
const HIDDEN: usize = 32;
/// Most steps of a training.
const STEPS: usize = 4000;
/// Steps between checks on the validation set.
const CHECKED_EVERY: usize = 10;
/// Checks without a lower error that end a training.
const PATIENCE: usize = 30;
/// Step size and weight decay of `AdamW`.
const LEARNING_RATE: f64 = 5e-3;
const WEIGHT_DECAY: f64 = 1e-2;
/// Seed of the first weights; each member has a stream of its own.
const SEED: u64 = 1;

/// A trained network.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Member {
    layers: Vec<Layer>,
    /// Mean squared error on the validation set, per output.
    pub(super) validation_error: f64,
}

/// `x W + b`: a column of W for each unit.
#[derive(Debug, Clone, PartialEq)]
struct Layer {
    weights: DMatrix<f64>,
    bias: RowDVector<f64>,
}

/// Inputs and outputs, a row for each station.
#[derive(Debug, Clone, Copy)]
pub(super) struct Set<'s> {
    pub(super) inputs: &'s DMatrix<f64>,
    pub(super) outputs: &'s DMatrix<f64>,
}

impl Member {
    /// The member of this number, trained on one set and stopped by another.
    pub(super) fn train(training: Set<'_>, validation: Set<'_>, number: u64) -> Result<Self> {
        let (training, validation) = (training.tensors()?, validation.tensors()?);
        let variables = first_layers(training.0.dim(1)?, training.1.dim(1)?, number)
            .iter()
            .map(Layer::variables)
            .collect::<Result<Vec<_>>>()?;
        let parameters =
            ParamsAdamW { lr: LEARNING_RATE, weight_decay: WEIGHT_DECAY, ..ParamsAdamW::default() };
        let mut optimizer = AdamW::new(variables.iter().flatten().cloned().collect(), parameters)?;
        let mut best = Self::of(&variables, &validation)?;
        let mut since = 0;
        for step in 1..=STEPS {
            optimizer.backward_step(&error(&variables, &training)?)?;
            if !step.is_multiple_of(CHECKED_EVERY) {
                continue;
            }
            let own = Self::of(&variables, &validation)?;
            since += 1;
            if own.validation_error < best.validation_error {
                (best, since) = (own, 0);
            }
            if since == PATIENCE {
                break;
            }
        }
        Ok(best)
    }

    /// The network with its error on the validation set.
    fn of(variables: &[[Var; 2]], validation: &(Tensor, Tensor)) -> Result<Self> {
        let layers = variables.iter().map(Layer::of);
        Ok(Self {
            layers: layers.collect::<Result<_>>()?,
            validation_error: error(variables, validation)?.to_scalar()?,
        })
    }

    /// Outputs at the inputs of one station.
    pub(super) fn at(&self, inputs: &RowDVector<f64>) -> RowDVector<f64> {
        let (last, hidden) = self.layers.split_last().expect("three layers");
        let units =
            hidden.iter().fold(inputs.clone(), |units, layer| layer.at(&units).map(f64::tanh));
        last.at(&units)
    }
}

impl Set<'_> {
    fn tensors(&self) -> Result<(Tensor, Tensor)> {
        Ok((tensor(self.inputs)?, tensor(self.outputs)?))
    }
}

impl Layer {
    fn at(&self, units: &RowDVector<f64>) -> RowDVector<f64> {
        units * &self.weights + &self.bias
    }

    fn variables(&self) -> Result<[Var; 2]> {
        let bias = DMatrix::from_row_slice(1, self.bias.len(), self.bias.as_slice());
        Ok([Var::from_tensor(&tensor(&self.weights)?)?, Var::from_tensor(&tensor(&bias)?)?])
    }

    fn of(variables: &[Var; 2]) -> Result<Self> {
        let [weights, bias] = variables;
        let (rows, columns) = weights.dims2()?;
        let values = weights.flatten_all()?.to_vec1()?;
        Ok(Self {
            weights: DMatrix::from_row_slice(rows, columns, &values),
            bias: RowDVector::from_vec(bias.flatten_all()?.to_vec1()?),
        })
    }
}

/// A tensor of the same rows.
fn tensor(matrix: &DMatrix<f64>) -> Result<Tensor> {
    // Columns of the transpose are rows of the matrix.
    let values = matrix.transpose().as_slice().to_vec();
    Tensor::from_vec(values, matrix.shape(), &Device::Cpu)
}

/// Mean squared error of all outputs.
fn error(layers: &[[Var; 2]], (inputs, outputs): &(Tensor, Tensor)) -> Result<Tensor> {
    let mut units = inputs.clone();
    for (place, [weights, bias]) in layers.iter().enumerate() {
        let sums = units.matmul(weights)?.broadcast_add(bias)?;
        let is_last = place + 1 == layers.len();
        units = if is_last { sums } else { sums.tanh()? };
    }
    (units - outputs)?.sqr()?.mean_all()
}

/// First weights of the member of this number: normal, with variance one over the inputs of their layer; biases are zero.
fn first_layers(inputs: usize, outputs: usize, number: u64) -> Vec<Layer> {
    let mut stream = ChaCha12Rng::seed_from_u64(SEED);
    stream.set_stream(number);
    let sizes = [inputs, HIDDEN, HIDDEN, outputs];
    let layer = |sizes: &[usize]| {
        let sd = (sizes[0] as f64).sqrt().recip();
        Layer {
            weights: DMatrix::from_fn(sizes[0], sizes[1], |_, _| sd * normal(&mut stream)),
            bias: RowDVector::zeros(sizes[1]),
        }
    };
    sizes.windows(2).map(layer).collect()
}

/// A standard normal number: Box and Muller's cosine branch on the upper 53 bits of two numbers.
fn normal(stream: &mut ChaCha12Rng) -> f64 {
    let mut uniform = || ((stream.next_u64() >> 11) as f64 + 0.5) / (1_u64 << 53) as f64;
    let radius = (-2.0 * uniform().ln()).sqrt();
    radius * (std::f64::consts::TAU * uniform()).cos()
}
