//! A small outcome made from a simulated session, as a run would make it.

use std::collections::BTreeMap;
use std::sync::LazyLock;

use nalgebra::{Isometry3, Matrix3, Point3, Vector3};

use crate::compensation::Conditions;
use crate::figures::{Counted, Figures};
use crate::fit::commanded::{CommandFrames, commanded};
use crate::fit::full::{FullModel, FullSettings};
use crate::fit::model::Spread;
use crate::fit::scale::{FittedScale, FreeScale, SessionScale};
use crate::fit::{
    self, At, Blocks, Calibration, ErrorFrame, FitSettings, Frames, Freedom, Gap, Models, Noise,
    Observation, PoseModel, Prediction, Purpose, Source, SourceId, SourceSize, ToolErrors,
    TrackerUncertainty, TrainingSettings,
};
use crate::geometry::{Transform, isometry_from_rpy};
use crate::grid::{self, GridInput, GridSettings, GridStation, Grids, Reach, Tolerance, Verdict};
use crate::ingest::{LogReject, LossKind, SpanClock, StandsOn};
use crate::io::tables::PublishContext;
use crate::join::references::{Look, ReferenceId, follow};
use crate::join::tabled::{LookAt, ReadReference, ReferenceCourse};
use crate::join::{
    ClockEstimate, JoinReject, Joined, ReadingCounts, ReadingKind, RejectCode, RowItem, RowReject,
    Station, Thresholds,
};
use crate::judgement::{
    JoinedSession, LengthResidual, Outcome, SeveralTargets, Source as OfSource,
};
use crate::kinematics::{Arm, RobotFile};
use crate::manifest::RunKey;
use crate::progress::Quiet;
use crate::report::compared::Pairs;
use crate::report::frame::StatedFrame;
use crate::report::iso_9283::{Characteristic, Figure, Iso9283};
use crate::report::verdict::{Judge, ProductVerdict, RunVerdict};
use crate::report::{
    Accuracy, Angles, BaseRefit, Calibrated, Model, Moment, Point, Residual, ResidualSet, Split,
    Subject,
};
use crate::similarity::{ErrorSample, SimilaritySettings, semivariograms};
use crate::simulate::settings::Cell;
use crate::simulate::{Poses, SimulateSettings, simulate};
use crate::units::{ClockModel, Stamp};

pub(super) const SESSION: &str = "2026-11 \"grid\"/a";

pub(super) static ARM: LazyLock<Arm> = LazyLock::new(|| {
    let text = include_str!("../../../../../../pipelines/robots/kr210-r2700-extra.toml");
    let file: RobotFile = toml::from_str(text).expect("a robot file");
    file.arm().expect("a valid arm")
});

pub(super) static FIT: LazyLock<FitSettings> = LazyLock::new(FitSettings::default);

/// Few harmonics: the tables are the same, and training takes no time.
pub(super) static FULL: LazyLock<FullSettings> =
    LazyLock::new(|| FullSettings { harmonics: 8, ..FullSettings::default() });

pub(super) const TOLERANCE: Tolerance = Tolerance { mm: 0.5, share: 0.95, confidence: 0.95 };

pub(super) static OUTCOME: LazyLock<Outcome<'static>> = LazyLock::new(outcome);

/// Commands are stated in a frame that is turned a quarter and shifted from the base.
pub(super) fn command_from_base() -> Isometry3<f64> {
    isometry_from_rpy([100.0, -20.0, 5.0], [0.0, 0.0, std::f64::consts::FRAC_PI_2])
}

pub(super) fn context() -> PublishContext<'static> {
    PublishContext {
        arm: &ARM,
        command_from_base: Transform::claim(command_from_base()),
        fit: &FIT,
        full: &FULL,
        tolerance: TOLERANCE,
        noise_mm2: Some(1e-3),
        valid_for: Conditions {
            tool: Some("drill".to_owned()),
            payload_kg: Some(120.0),
            ..Conditions::default()
        },
        made_of: vec![RunKey::new("kr210", SESSION, "0123456789abcdef")],
        grids: "89abcdef01234567".to_owned(),
        estimate: "fedcba9876543210".to_owned(),
        replaces: None,
        pairs: Pairs::default(),
    }
}

/// 45 stations on a grid in one orientation; some are lost.
fn stations() -> Vec<Station> {
    let home = [0.0, -75.0, 100.0, 25.0, 55.0, -15.0_f64].map(f64::to_radians);
    let poses = Poses::Grid {
        lower_mm: [1400.0, -200.0, 800.0],
        upper_mm: [1600.0, 200.0, 1000.0],
        step_mm: 100.0,
        orientation_rpy: [3.0, 0.3, 0.1],
    };
    let mut settings = SimulateSettings::realistic(42, home.to_vec(), poses);
    settings.tracker.lost_share = 0.1;
    simulate(&ARM, &settings).expect("in reach").stations()
}

fn session(stations: Vec<Station>) -> JoinedSession {
    let cell = Cell::default();
    let frames = CommandFrames {
        base_from_command: Isometry3::identity(),
        flange_from_tool: Some(isometry_from_rpy(
            cell.flange_from_target_mm,
            cell.flange_from_target_rpy,
        )),
    };
    let commanded = commanded(&stations, &ARM, &frames);
    JoinedSession {
        name: SESSION.to_owned(),
        sampling_plan: None,
        set_up: None,
        stated_sizes: Vec::new(),
        driven_by: None,
        log_rejects: vec![log_reject(Some(3)), log_reject(None)],
        counts: BTreeMap::from(
            [("joints.messages", 10), ("joints.kept", 7), ("joints.rejected", 3)]
                .map(|(name, count)| (name.to_owned(), count)),
        ),
        joined: Joined {
            stations,
            clock: clock(),
            rejects: vec![JoinReject {
                start: Stamp::from_ns(5),
                end: Stamp::from_ns(9),
                readings: 4,
                is_of_reference: false,
                code: RejectCode::Moving,
                reason: "moving: the target was not stationary".to_owned(),
            }],
            row_rejects: vec![RowReject {
                kind: RowItem::Reading,
                file: "measured.csv".to_owned(),
                line: 734,
                column: Some("x [mm]".to_owned()),
                station: Some(2),
                code: RejectCode::Missing,
                reason: "missing: the cell is blank".to_owned(),
            }],
            references: vec![references()],
            read_references: vec![ReadReference {
                name: "F1".to_owned(),
                on: StandsOn::Floor,
                looks: 4,
                between: Some([0, 2]),
            }],
            elsewhere: Vec::new(),
            knocks: Vec::new(),
            counts: ReadingCounts { kept: 20, moving: 4, missing: 1, ..ReadingCounts::default() },
            found: Thresholds { stationary_rad: 1e-4, stationary_mm: 0.1, settle_s: 0.2 },
        },
        commanded,
    }
}

/// Two references on the floor, read at four rows of which one is no station.
fn references() -> ReferenceCourse {
    let look = |place: u32| Look {
        at_s: f64::from(place),
        seen: [0.0, 900.0]
            .into_iter()
            .enumerate()
            .map(|(own, x)| (ReferenceId(own), Point3::new(x, 0.01 * f64::from(place), 5.0)))
            .collect(),
    };
    let looks: Vec<Look> = (0..4).map(look).collect();
    let at = |place: usize| LookAt {
        line: 2 + place as u64,
        at_ns: 1_000_000_000 * [0, 1, 2, 3][place],
        station: (place != 1).then_some(place),
        seen: 2,
    };
    ReferenceCourse {
        on: StandsOn::Floor,
        names: ["F1", "F2"].map(str::to_owned).into(),
        followed: follow(&looks).expect("four looks"),
        looks: (0..4).map(at).collect(),
        is_taken_out: true,
        is_timed: false,
        is_logged: false,
    }
}

/// The part of an instrument; of the second as if it were one more.
fn of_source(number: usize, geometric: &Calibration) -> OfSource {
    OfSource {
        model: Model::Geometric,
        name: format!("tracker {number}"),
        size: SourceSize { source: SourceId(number), ..geometric.sources[0].clone() },
        factor: Some(1.0),
        is_fitted: true,
        gauge: None,
        held_out: 0,
        held_out_rms_mm: None,
    }
}

/// Residual of a distance in training, or held out by a fold.
fn length_residual(fold: Option<usize>) -> LengthResidual {
    LengthResidual {
        model: Model::Geometric,
        fold,
        session: "mon".to_owned(),
        station: 3,
        pose: 3,
        source: SourceId(1),
        name: "bar".to_owned(),
        kind: ReadingKind::Distance,
        target: None,
        measured_mm: 1234.5,
        predicted_mm: 1234.25,
        sd_mm: fold.map(|_| 0.05),
        weight: fold.is_none().then_some(1.0),
    }
}

fn log_reject(messages: Option<u64>) -> LogReject {
    LogReject {
        file: "controller.mcap".to_owned(),
        topic: messages.map(|_| "/joint_states".to_owned()),
        byte_start: 100,
        byte_end: 164,
        time_span_ns: messages.map(|_| (1, 2)),
        clock: SpanClock::Log,
        messages,
        loss: messages.map_or(LossKind::Bytes, |_| LossKind::Unusable),
        reason: "a joint angle is not a finite number".to_owned(),
    }
}

fn clock() -> ClockEstimate {
    ClockEstimate {
        model: ClockModel { origin: Stamp::from_ns(7), offset_ns: -4.131e9, drift: -25e-6 },
        offset_se_ns: 1e5,
        drift_se: 1e-7,
        matched_edges: 80,
        edge_rms_ns: 2e6,
        method: "by hand".to_owned(),
        steps: Vec::new(),
    }
}

/// The identified arm with a covariance that differs along the axes of the base.
#[derive(Debug)]
struct Identified(Calibration);

impl PoseModel for Identified {
    fn frames(&self) -> &[Frames] {
        self.0.frames()
    }

    fn predict(&self, at: &At<'_>) -> Result<Prediction, Gap> {
        self.0.predict(at)
    }

    fn spread(&self, session: usize, source: SourceId, _: &Prediction) -> Spread {
        let base = self.0.frames[session].tracker_from_base(source).isometry().rotation;
        let covariance = Spread::Of(Matrix3::from_diagonal(&Vector3::new(1e-4, 2e-4, 3e-4)));
        Spread::Of(covariance.seen_from(&base))
    }

    fn saved(&self, _: &Arm, _: &[&str]) -> Option<Result<String, serde_json::Error>> {
        None
    }
}

/// The stations of the session in the form of the fit.
fn observations(session: &JoinedSession) -> Vec<Observation> {
    let noise = Noise::of_one(
        Source {
            reads: ReadingKind::Point,
            uncertainty: TrackerUncertainty {
                range_um: 10.0,
                range_um_per_m: 0.3,
                transverse_um: 15.0,
                transverse_um_per_m: 6.0,
                divisor: 2.0,
                orientation_rad: None,
            }
            .into(),
        },
        0.03,
    );
    let mut observations = fit::observations(0, &session.joined.stations, &ARM, &noise);
    for observation in &mut observations {
        observation
            .settling_error
            .clone_from(&session.commanded.settling_errors[observation.station]);
    }
    observations
}

/// The models of a training on the session, and the observations that it was made from.
pub(super) fn trained() -> (Models, Vec<Observation>) {
    let observations = observations(&session(stations()));
    let settings = TrainingSettings {
        fit: &FIT,
        full: &FULL,
        up: Some(Vector3::z_axis()),
        purpose: Purpose::Published,
    };
    let models = fit::models::train(&ARM, &observations, 1, &settings);
    (models.expect("a fit"), observations)
}

fn outcome() -> Outcome<'static> {
    let session = session(stations());
    let observations = observations(&session);
    let identify = |freedom| fit::identify(&ARM, &observations, 1, freedom, &FIT).expect("a fit");
    let base_target = identify(Freedom::BaseAndTarget);
    let geometric = identify(Freedom::Geometry);
    let full = FullModel::train(
        &ARM,
        &observations,
        (&geometric.frames[..], &geometric.geometry[..]),
        &FIT.prior(),
        &FULL,
        Purpose::Published,
        Some(Vector3::z_axis()),
    );
    let error_frame = ErrorFrame::new(&ARM, base_target.frames[0].one().unwrap(), None, false);
    let grids = grids(&session.joined.stations, &error_frame, &geometric);
    let samples = samples(&session.joined.stations, &error_frame);
    Outcome {
        sources: [0, 1].map(|number| of_source(number, &geometric)).into(),
        length_residuals: [None, Some(2)].map(length_residual).into(),
        targets: SeveralTargets::default(),
        residuals: vec![residuals(&session.joined.stations, &error_frame)],
        driven: None,
        verdict: RunVerdict::of(
            ProductVerdict::of(vec![Judge::blocks(SESSION, &accuracy(false), None, &TOLERANCE)]),
            Vec::new(),
            Model::Full,
        ),
        scales: vec![scale()],
        accuracy: vec![accuracy(true), accuracy(false)],
        iso_9283: vec![iso_9283()],
        at_tip: vec![],
        semivariograms: vec![(
            Model::BaseTarget,
            semivariograms(&samples, &SimilaritySettings::default()),
        )],
        calibrations: vec![(Model::BaseTarget, base_target), (Model::Geometric, geometric)],
        full: Some(full.expect("positive definite")),
        camera_size: None,
        stated_sizes: Vec::new(),
        best: Model::Full,
        training: vec![session],
        test: Vec::new(),
        frame: StatedFrame {
            is_surveyed: false,
            tracker_from_base: *error_frame.frames.tracker_from_base.isometry(),
            sd_mm: Some(0.01),
            sd_deg: Some(0.001),
            lever_sd_mm: None,
            open_mm: None,
        },
        error_frame,
        grids,
    }
}

fn samples(stations: &[Station], error_frame: &ErrorFrame<'_>) -> Vec<ErrorSample> {
    let sample = |station: &Station| {
        Some(ErrorSample {
            joints: station.joints.clone(),
            position: error_frame.nominal_target(&station.joints),
            error: error_frame.tool_error(station, &error_frame.nominal_target(&station.joints))?,
        })
    };
    stations.iter().filter_map(sample).collect()
}

fn grids(stations: &[Station], error_frame: &ErrorFrame<'_>, calibration: &Calibration) -> Grids {
    let reach = Reach::new(&ARM, error_frame.flange_from_tool);
    let attained: Vec<_> = stations.iter().filter(|s| s.one_reading().is_some()).collect();
    let tools: Vec<_> = attained.iter().map(|s| error_frame.nominal_tool(&s.joints)).collect();
    let positions: Vec<_> = tools.iter().map(|tool| tool.translation.vector.into()).collect();
    let folds = Blocks::default().folds(&positions);
    let errors = samples(stations, error_frame);
    let station = |place: usize| GridStation {
        number: attained[place].number,
        pose: attained[place].number,
        position: positions[place],
        orientation: tools[place].rotation,
        joints: attained[place].joints.clone(),
        configuration: reach.configuration(&attained[place].joints),
        error: errors[place].error,
        fold: folds[place],
        between_sessions: Vec::new(),
    };
    let stations: Vec<GridStation> = (0..attained.len()).map(station).collect();
    let model = Identified(calibration.clone());
    let errors = ToolErrors::new(&model, 0, error_frame);
    let input =
        GridInput { stations: &stations, folds: &[errors; 8], model: errors, guard_mm: 0.05 };
    let settings: GridSettings = toml::from_str("steps_mm = [100.0, 200.0]").expect("[grid]");
    grid::grids(&input, &reach, &settings, &TOLERANCE, None, &Quiet).expect("grids")
}

fn subject(split: Split, model: Model) -> Subject {
    Subject {
        split,
        of_session: SESSION.to_owned(),
        model,
        angles: Angles::Reported,
        base_refit: BaseRefit::None,
    }
}

fn residuals(stations: &[Station], error_frame: &ErrorFrame<'_>) -> ResidualSet {
    let residual = |station: &Station| {
        let residual =
            error_frame.tool_error(station, &error_frame.nominal_target(&station.joints))?;
        Some(Residual {
            station: station.number,
            target: None,
            pose: station.number,
            fold: Some(0),
            used_for_refit: false,
            attained: error_frame.nominal_target(&station.joints) + residual,
            residual,
            covariance: Some(Matrix3::identity() * 0.25),
            weight: None,
            turn: None,
        })
    };
    ResidualSet {
        subject: subject(Split::Blocks, Model::BaseTarget),
        residuals: stations.iter().filter_map(residual).collect(),
    }
}

fn scale() -> SessionScale {
    SessionScale {
        session: SESSION.to_owned(),
        stations: 20,
        lengths: Vec::new(),
        prior_sd_ppm: 50.0,
        fitted: Some(FittedScale { ppm: 2.0, sd_ppm: 49.0, kept: true }),
        length_sd_mm: 0.3,
        free: Some(FreeScale { ppm: 1000.0, sd_ppm: 176.0, length_rms_mm: 0.2 }),
    }
}

/// With figures, or with none.
fn accuracy(there: bool) -> Accuracy {
    let model = if there { Model::Full } else { Model::Table };
    Accuracy {
        subject: subject(Split::Blocks, model),
        point: if there { Point::Measured } else { Point::Tool },
        moment: Moment::After,
        driven_by: None,
        figures: Figures::of(&[0.1, 0.2, 0.3]).filter(|_| there),
        bound: None,
        counted: Counted::once(if there { 3 } else { 0 }),
        finders: None,
        blocks: Some(2),
        coverage: there.then_some(Calibrated { inside: 0.96, mean_squared_distance: 2.9 }),
        expanded_uncertainty_mm: 0.05,
        verdict: Verdict::NotShown("3 held-out stations; 59 are needed".to_owned()),
    }
}

/// A length and an angle of a pose visited twice, and a figure that its visits do not allow.
fn iso_9283() -> Iso9283 {
    let figure = |characteristic, pose, value| Figure {
        characteristic,
        pose,
        value,
        n: 2,
        n_needed: 30,
        remark: Some("no pose was visited thirty times".to_owned()),
    };
    Iso9283 {
        subject: subject(Split::None, Model::BaseTarget),
        point: Point::Tool,
        moment: Moment::Before,
        driven_by: None,
        expanded_uncertainty_mm: 0.05,
        figures: vec![
            figure(Characteristic::ApP, Some(4), Some(0.4)),
            figure(Characteristic::VapP, None, None),
            figure(Characteristic::ApA, Some(4), Some(-2e-4)),
        ],
    }
}
