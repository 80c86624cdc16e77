//! The full error model: its entry in the registry, and its implementation of the common interface.

use nalgebra::{DMatrix, Isometry3, Matrix3, Point3};

use super::{About, Corrects, Loaded};
use crate::fit::Frames;
use crate::fit::full::FullModel;
use crate::fit::full::saved::SavedFull;
use crate::fit::gap::Gap;
use crate::fit::model::{Angles, At, Open, PartEvidence, PoseModel, Prediction, Query, Spread};
use crate::fit::observation::Observation;
use crate::fit::saved::{SavedError, SavedHead};
use crate::join::SourceId;
use crate::kinematics::Arm;

pub(super) const ABOUT: About = About {
    word: "full",
    name: "full error model",
    look: 0,
    corrects: Corrects::Predicted,
    angles: &[Angles::Weighted, Angles::Commanded],
    serves: true,
    of_training: Some(|models| models.full.as_ref().map(|full| full as &dyn PoseModel)),
    load: Some(load),
};

fn load(text: &str, _: Option<f64>) -> Result<Loaded, SavedError> {
    let saved = SavedFull::read(text)?;
    let model = FullModel::from_saved(&saved)?;
    let head = SavedHead { arm: saved.arm, sessions: saved.sessions };
    Ok(Loaded { head, model: Box::new(model) })
}

impl FullModel {
    /// The uncertainty of a prediction in another session, from what the model leaves open of it, mm².
    fn spread_elsewhere(
        &self,
        session: usize,
        source: SourceId,
        prediction: &Prediction,
        open: Matrix3<f64>,
    ) -> Spread {
        // A command is used in another session, whose base drift is not known.
        let drift = Matrix3::identity() * self.any_time_variance();
        // Its scale is not known either: corrections are those of the mean scale of all sessions.
        let scale = self.any_scale_covariance(session, source, &prediction.position);
        Spread::Of(open + drift + scale)
    }
}

impl PoseModel for FullModel {
    fn frames(&self) -> &[Frames] {
        &self.frames
    }

    fn predict(&self, at: &At<'_>) -> Result<Prediction, Gap> {
        let predicted = self.predict(at.joints()?);
        Ok(Prediction {
            position: predicted.position,
            flange: predicted.flange,
            error: None,
            open: Some(Open { rows: predicted.rows, alone: predicted.approach }),
        })
    }

    fn position(&self, at: &At<'_>) -> Result<Point3<f64>, Gap> {
        Ok(self.position(at.joints()?))
    }

    fn pose(&self, query: &Query<'_>) -> Result<Isometry3<f64>, Gap> {
        Ok(self.pose(query))
    }

    fn spread(&self, session: usize, source: SourceId, prediction: &Prediction) -> Spread {
        self.spreads(session, source, &[prediction])[0]
    }

    fn spreads(
        &self,
        session: usize,
        source: SourceId,
        predictions: &[&Prediction],
    ) -> Vec<Spread> {
        let open: Vec<&Open> = predictions.iter().filter_map(|own| own.open.as_ref()).collect();
        // Without a prediction there are rows of the model's columns still, none of them.
        let mut rows = DMatrix::zeros(3 * open.len(), self.trained.layout.size());
        for (place, own) in open.iter().enumerate() {
            rows.rows_mut(3 * place, 3).copy_from(&own.rows);
        }
        let mut covariances = self.covariances(&rows).into_iter();
        let of = |own: &&Prediction| {
            let open = own.open.as_ref();
            let open = open.and_then(|open| Some(covariances.next()? + open.alone));
            self.spread_elsewhere(session, source, own, open.unwrap_or_else(Matrix3::zeros))
        };
        predictions.iter().map(of).collect()
    }

    fn covariances(&self, rows: &DMatrix<f64>) -> Vec<Matrix3<f64>> {
        self.covariances(rows)
    }

    fn noise(&self, observation: &Observation, session: usize) -> Matrix3<f64> {
        self.noise(observation, session)
    }

    fn visit(&self, query: &Query<'_>) -> Matrix3<f64> {
        self.visit_covariance(query)
    }

    fn scale_sd(&self) -> f64 {
        self.trained.scale_sd
    }

    fn parts(&self) -> &'static [&'static str] {
        &["geometry"]
    }

    fn optional_parts(&self) -> &[PartEvidence] {
        &self.trained.parts
    }

    fn parameter_count(&self) -> usize {
        self.trained.layout.size()
    }

    fn weights(&self) -> &[f64] {
        &self.trained.weights
    }

    fn saved(&self, arm: &Arm, names: &[&str]) -> Option<Result<String, serde_json::Error>> {
        Some(serde_json::to_string(&self.saved(arm, names)))
    }
}
