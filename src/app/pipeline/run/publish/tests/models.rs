//! Models of the registry: their words are those of the schemas, and saved models predict like the originals.

use std::collections::BTreeSet;

use super::example::{ARM, SESSION, trained};
use crate::files::schema;
use crate::fit::model::{At, Query};
use crate::fit::{Model, PoseModel, SourceId};

/// The allowed values of a column.
fn allowed(table: &str, column: &str) -> BTreeSet<&'static str> {
    let schema = schema::find(table).unwrap();
    let column = schema.columns.iter().find(|own| own.name == column);
    let values = column.unwrap().values.as_ref().unwrap();
    values.iter().map(String::as_str).collect()
}

fn words(is: impl Fn(Model) -> bool) -> BTreeSet<&'static str> {
    let models = Model::ALL.iter().filter(|model| is(**model));
    models.map(|model| model.about().word).collect()
}

fn is_trained(model: Model) -> bool {
    model.about().of_training.is_some()
}

#[test]
fn the_words_of_models_are_those_that_the_schemas_allow() {
    assert_eq!(allowed("accuracy", "model"), words(|_| true));
    assert_eq!(allowed("residuals", "model"), words(|_| true));
    assert_eq!(allowed("calibrations", "model_kind"), words(is_trained));
    // Fewer models than these are asked for: every word is a model's, and those that are asked for are there.
    let all = words(|_| true);
    let serving = words(|model| model.about().serves);
    let compared = words(|model| !model.about().angles.is_empty());
    for (table, column, least) in [
        ("grid_steps", "model", &serving),
        ("parameters", "model", &serving),
        ("semivariograms", "errors", &compared),
    ] {
        let allowed = allowed(table, column);
        assert!(allowed.is_subset(&all), "{table}: {allowed:?}");
        assert!(least.is_subset(&allowed), "{table}: {allowed:?}");
    }
    assert_eq!(all.len(), Model::ALL.len(), "one word for each model");
    for model in Model::ALL {
        assert_eq!(Model::of_word(model.about().word), Some(*model));
    }
}

#[test]
fn a_model_that_was_saved_predicts_as_it_did() {
    let (models, observations) = trained();
    for &model in Model::ALL.iter().filter(|model| is_trained(**model)) {
        let own = models.get(model).unwrap();
        let text = own.saved(&ARM, &[SESSION]).unwrap().unwrap();
        let back =
            model.about().load.unwrap()(&text, Some(models.geometric.misfit_mm)).unwrap().model;
        let at = |model: &dyn PoseModel| {
            let at: Vec<At<'_>> =
                observations.iter().map(|observation| At::Joints(Query::of(observation))).collect();
            let one = model.predict(&at[0]).unwrap();
            let spread = model.spread(0, SourceId::ONLY, &one).covariance();
            (model.positions(&at), spread)
        };
        let ((there, spread), (here, back_spread)) = (at(own), at(&*back));
        assert_eq!(there.len(), observations.len());
        for (there, here) in there.iter().zip(&here) {
            let apart = (there.as_ref().unwrap() - here.as_ref().unwrap()).norm();
            assert!(apart < 1e-9, "{model:?}: {apart} mm");
        }
        if model.about().serves {
            assert!((spread - back_spread).abs().max() < 1e-12, "{model:?}");
        }
        assert_eq!(own.frames().len(), back.frames().len());
    }
}
