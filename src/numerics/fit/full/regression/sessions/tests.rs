use super::super::Evidence;
use super::*;

/// Three sessions with own columns between the shared ones, and the rows of each.
struct Pool {
    partition: Partition,
    rows: Vec<DMatrix<f64>>,
    values: Vec<DVector<f64>>,
    scale: DVector<f64>,
}

impl Pool {
    fn new() -> Self {
        let partition = Partition {
            own: vec![vec![1, 2, 7], vec![3, 8], vec![4, 9, 10, 11]],
            common: vec![0, 5, 6, 12],
        };
        let size = partition.size();
        let heights = [20, 9, 31];
        let sessions = partition.own.iter().zip(heights).enumerate();
        let rows = sessions.map(|(session, (own, height))| {
            let seen: Vec<usize> = own.iter().chain(&partition.common).copied().collect();
            let mut rows = DMatrix::zeros(height, size);
            for (row, mut entries) in rows.row_iter_mut().enumerate() {
                for &column in &seen {
                    entries[column] = ((17 * row + 5 * column + 3 * session) as f64 * 0.71).sin();
                }
            }
            rows
        });
        let value = |(session, height): (usize, usize)| {
            DVector::from_fn(height, |row, _| ((row + 7 * session) as f64).cos())
        };
        Self {
            rows: rows.collect(),
            values: heights.into_iter().enumerate().map(value).collect(),
            // Widths as of frames, curves and a part that was dropped.
            scale: DVector::from_fn(size, |column, _| [0.3, 40.0, 1.0, 0.0, 2.5][column % 5]),
            partition,
        }
    }

    fn sums(&self, sessions: &[usize]) -> SessionSums {
        let mut sums = SessionSums::zero(&self.partition);
        for &session in sessions {
            sums.add(session, &self.of(session));
        }
        sums
    }

    /// The sums of one session over the columns that it sees.
    fn of(&self, session: usize) -> Sums {
        let own = self.partition.own[session].iter();
        let seen: Vec<usize> = own.chain(&self.partition.common).copied().collect();
        let rows = self.rows[session].select_columns(&seen);
        Sums::new(&rows, &self.values[session], 0.4)
    }

    /// The posterior by the sums of all columns at once.
    fn dense(&self, sessions: &[usize]) -> Posterior {
        let mut sums = Sums::zero(self.partition.size());
        for &session in sessions {
            let own = Sums::new(&self.rows[session], &self.values[session], 0.4);
            sums.add(&own);
        }
        let posterior = sums.posterior_at(self.scale.clone());
        posterior.expect("positive definite")
    }

    fn arrow(&self, sessions: &[usize]) -> Posterior {
        let posterior = self.sums(sessions).posterior_at(self.scale.clone());
        posterior.expect("positive definite")
    }
}

fn assert_same(found: &DMatrix<f64>, wanted: &DMatrix<f64>, what: &str) {
    let apart = (found - wanted).amax();
    assert!(apart < 1e-9 * (1.0 + wanted.amax()), "{what}: {apart}");
}

#[test]
fn an_arrow_is_the_dense_regression() {
    let pool = Pool::new();
    let (arrow, dense) = (pool.arrow(&[0, 1, 2]), pool.dense(&[0, 1, 2]));
    assert!((arrow.mean() - dense.mean()).amax() < 1e-10);
    assert!((arrow.log_evidence - dense.log_evidence).abs() < 1e-9);
    let determined = |own: &Posterior| own.determined(&own.inverse());
    assert!((determined(&arrow) - determined(&dense)).amax() < 1e-10);
    for session in 0..3 {
        let rows = &pool.rows[session];
        let covariance = |posterior: &Posterior| {
            let half = posterior.half(rows);
            half.tr_mul(&half)
        };
        assert_same(&covariance(&arrow), &covariance(&dense), "predictions");
    }
    let all: Vec<usize> = (0..pool.partition.size()).collect();
    let covariance = dense.covariance_of(&all);
    assert_same(&arrow.covariance_of(&all), &covariance, "covariance");
    let lower = |posterior: &Posterior| posterior.factor().lower().lower_triangle();
    assert_same(&lower(&arrow), &lower(&dense), "factor");
}

#[test]
fn a_session_has_the_covariance_of_what_it_sees() {
    let pool = Pool::new();
    let (arrow, dense) = (pool.arrow(&[0, 1, 2]), pool.dense(&[0, 1, 2]));
    let by_session = arrow.by_session(arrow.inverse());
    for (session, own) in pool.partition.own.iter().enumerate() {
        let seen: Vec<usize> = own.iter().chain(&pool.partition.common).copied().collect();
        let found = by_session.of(session, &seen).into_owned();
        assert_same(&found, &dense.covariance_of(&seen), "what a session sees");
    }
}

#[test]
fn draws_have_the_posterior_covariance() {
    let pool = Pool::new();
    let arrow = pool.arrow(&[0, 1, 2]);
    let size = pool.partition.size();
    let mut root = DMatrix::zeros(size, size);
    for column in 0..size {
        let unit = DVector::from_fn(size, |row, _| f64::from(u8::from(row == column)));
        let drawn = arrow.backward(unit).component_mul(&arrow.scale);
        root.set_column(column, &drawn);
    }
    let all: Vec<usize> = (0..size).collect();
    assert_same(&(&root * root.transpose()), &arrow.covariance_of(&all), "draws");
}

#[test]
fn the_gain_of_a_part_is_what_the_evidence_loses_without_it() {
    let pool = Pool::new();
    let sums = Evidence::Sessions(pool.sums(&[0, 1, 2]));
    let (arrow, dense) = (pool.arrow(&[0, 1, 2]), pool.dense(&[0, 1, 2]));
    for columns in [vec![1, 8, 10], vec![0], vec![5, 9]] {
        let found = sums.gain_of(&arrow, &columns).expect("positive definite");
        let wanted = dense.gain_of(&columns).expect("positive definite");
        assert!((found - wanted).abs() < 1e-9, "{columns:?}: {found} {wanted}");
    }
}
