//! Tables as people have them, read by a section: units, sums, long form, missing readings, sessions.

use std::fs;
use std::path::PathBuf;

use super::*;
use crate::join::tabled::RowItem;
use crate::join::{TargetId, Value};

/// A file in a folder of its own.
struct Table {
    folder: tempfile::TempDir,
}

impl Table {
    fn new(text: &str) -> Self {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("measured.csv"), text).unwrap();
        Self { folder }
    }

    fn path(&self) -> PathBuf {
        self.folder.path().join("measured.csv")
    }

    fn read(&self, section: &str, session: Option<&str>) -> Result<StationTable, String> {
        let settings = settings(section);
        let whose = of_session(session);
        read(&self.path(), &settings, &whose, &[false, true], Bound::TARGETS)
            .map_err(|error| error.to_string())
    }
}

fn of_session(session: Option<&str>) -> Whose {
    Whose { robot: None, session: session.map(str::to_owned) }
}

fn settings(section: &str) -> StationsSettings {
    toml::from_str(section).unwrap_or_else(|error| panic!("{error}"))
}

const WIDE: &str = "joints = [\"a\", \"s\"]\njoint_unit = \"deg\"\nlength_unit = \"m\"\n\
    [[measured]]\nname = \"A\"\nposition = [\"x\", \"y\", \"z - 1\"]\nunit = \"m\"\nsd = [\"sd\", \"sd\", \"sd\"]\n\
    [[measured]]\nname = \"B\"\nposition = [\"u\", \"v\", \"w\"]\nunit = \"mm\"\n\
    orientation = { rotation_vector = [\"r\", \"r\", \"r\"], unit = \"deg\" }\n";

#[test]
fn units_sums_and_two_targets_are_read() {
    let table = Table::new(
        "a,s,x,y,z,sd,u,v,w,r\n\
         90,0.25,1,2,3,0.001,10,20,30,0\n\
         180,0.5,4,5,6,,9999,0,1,0\n",
    );
    let read = table.read(WIDE, None).unwrap();
    assert_eq!((read.read, read.rows.rows.len(), read.rows.rejects.len()), (2, 2, 1));
    let first = &read.rows.rows[0];
    assert!((first.joints[0] - std::f64::consts::FRAC_PI_2).abs() < 1e-15);
    assert!((first.joints[1] - 250.0).abs() < 1e-12);
    let Value::Point(point) = first.readings[0].value else {
        panic!("{:?} is no point", first.readings[0].value)
    };
    assert_eq!(point.position, nalgebra::Point3::new(1000.0, 2000.0, 2000.0));
    assert_eq!(nalgebra::Vector3::from(point.scatter_mm), nalgebra::Vector3::repeat(1.0));
    assert!(matches!(first.readings[1].value, Value::Pose(..)));
    // The second station's second target was not measured; a blank deviation leaves the instrument's.
    let second = &read.rows.rows[1];
    assert_eq!(second.readings.len(), 1);
    let scatter_mm = second.readings[0].value.point().unwrap().scatter_mm;
    assert_eq!(nalgebra::Vector3::from(scatter_mm), nalgebra::Vector3::zeros());
    let reject = &read.rows.rejects[0];
    assert_eq!(
        (reject.kind, reject.line, reject.column.as_deref()),
        (RowItem::Reading, 3, Some("u"))
    );
}

#[test]
fn rows_of_a_long_table_that_name_an_instrument_are_its_lengths() {
    let table = Table::new(
        "p,i,a,s,x,y,z,L\n\
         1,smr,90,0.25,1,2,3,\n\
         1,wire,90,0.25,,,,812.5\n\
         2,wire,180,0.5,,,,700\n\
         2,wire,180,0.5,,,,701\n\
         2,other,180,0.5,,,,5\n",
    );
    let section = "joints = [\"a\", \"s\"]\njoint_unit = \"deg\"\nlength_unit = \"m\"\nstation = \"p\"\ntarget = \"i\"\ntargets = [\"smr\"]\n\
        [[measured]]\nposition = [\"x\", \"y\", \"z\"]\nunit = \"m\"\n\
        [[lengths]]\nname = \"wire\"\nreads = \"distance\"\ncolumn = \"L\"\nunit = \"mm\"\nsd_mm = 0.1\n";
    let read = table.read(section, None).unwrap();
    let [first, second] = &read.rows.rows[..] else {
        panic!("{:?}", read.rows.rows);
    };
    let lengths = |own: &crate::join::tabled::Row| {
        let readings = own.readings.iter();
        let lengths = readings.filter_map(|own| Some((own.source.0, own.value.length()?.mm)));
        lengths.collect::<Vec<_>>()
    };
    assert_eq!(lengths(first), [(1, 812.5)]);
    assert_eq!(first.readings.len(), 2);
    assert_eq!(lengths(second), [(1, 700.0)]);
    let rejects: Vec<_> =
        read.rows.rejects.iter().map(|own| (own.line, own.reason.as_str())).collect();
    assert_eq!(rejects.len(), 2, "{rejects:?}");
    assert!(
        rejects[0].0 == 5 && rejects[0].1.contains("of this instrument already"),
        "{rejects:?}"
    );
    assert!(rejects[1].0 == 6 && rejects[1].1.contains("\"other\""), "{rejects:?}");
}

#[test]
fn rows_of_a_long_table_with_one_name_are_a_station() {
    let section = "joints = [\"a\", \"s\"]\njoint_unit = \"rad\"\nlength_unit = \"mm\"\nstation = \"pose\"\ntarget = \"ball\"\n\
        targets = [\"A\", \"B\", \"C\"]\n[measured]\nposition = [\"x\", \"y\", \"z\"]\nunit = \"mm\"\n";
    let table = Table::new(
        "pose;ball;a;s;x;y;z\n\
         p1;C;0,1;5;7;8;9\n\
         p1;A;0,1;5;1;2;3\n\
         p2;A;0,2;6;1;2;4\n\
         p1;B;0,9;5;1;2;3\n\
         p2;A;0,2;6;1;2;5\n\
         p2;F;0,2;6;1;2;5\n\
         ;A;0,2;6;1;2;5\n",
    );
    let read = table.read(section, None).unwrap();
    assert_eq!((read.read, read.rows.rows.len()), (7, 2));
    let targets: Vec<TargetId> =
        read.rows.rows[0].readings.iter().map(|reading| reading.target).collect();
    assert_eq!(targets, [TargetId(0), TargetId(2)]);
    let told: Vec<(u64, &str)> =
        read.rows.rejects.iter().map(|own| (own.line, own.reason.as_str())).collect();
    let expected = [
        (5, "not those of line 2"),
        (6, "has a reading of this target already"),
        (7, "\"F\" is none of [stations] targets"),
        (8, "names no station"),
    ];
    assert_eq!(told.len(), expected.len(), "{told:?}");
    for ((line, reason), (wanted, words)) in told.into_iter().zip(expected) {
        assert!(line == wanted && reason.contains(words), "{line}: {reason}");
    }
}

#[test]
fn a_session_is_its_own_rows_whatever_stands_beside_them() {
    let section = "joints = [\"a\", \"s\"]\njoint_unit = \"deg\"\nlength_unit = \"mm\"\nsession = \"day\"\n\
        [measured]\nposition = [\"x\", \"y\", \"z\"]\nunit = \"mm\"\n";
    let one = "day,a,s,x,y,z\nmon,1,2,3,4,5\ntue,1,2,3,4,6\nmon,2,2,3,4,7\n";
    let more = "day;a;s;x;y;z\nwed;1;2;3;4;5\nmon;1,0;2;3;4;5\nmon;2;2;3;4;7\n";
    let (one, more) = (Table::new(one), Table::new(more));
    let settings = settings(section);
    let names = |table: &Table| named(&table.path(), &settings, Bound::TARGETS).unwrap().0;
    let expected = |names: [&str; 2]| names.map(|name| of_session(Some(name))).into();
    assert_eq!(names(&one), expected(["mon", "tue"]));
    assert_eq!(names(&more), expected(["mon", "wed"]));
    assert_eq!(one.read(section, Some("mon")).unwrap().rows.rows.len(), 2);
    let own = |table: &Table, session| {
        let whose = of_session(Some(session));
        own_text(&table.path(), &settings, &whose, Bound::TARGETS).unwrap()
    };
    assert_eq!(own(&one, "mon"), own(&more, "mon"));
    assert_ne!(own(&one, "mon"), own(&one, "tue"));
    assert!(one.read(section, Some("sun")).unwrap_err().contains("no row of a station"));
}

#[test]
fn rows_are_those_of_one_robot_and_those_that_name_none_are_told() {
    let section = "joints = [\"a\", \"s\"]\njoint_unit = \"deg\"\nlength_unit = \"mm\"\nrobot = \"arm\"\n\
        [measured]\nposition = [\"x\", \"y\", \"z\"]\nunit = \"mm\"\n";
    let table = Table::new("arm,a,s,x,y,z\n7,1,2,3,4,5\n8,1,2,3,4,6\n,1,2,3,4,6\n7,2,2,3,4,7\n");
    let settings = settings(section);
    let of_robot = |robot: &str| Whose { robot: Some(robot.to_owned()), session: None };
    let (names, nameless) = named(&table.path(), &settings, Bound::TARGETS).unwrap();
    assert_eq!(names, [of_robot("7"), of_robot("8")].into());
    assert_eq!(nameless, [4]);
    let rows = |whose: &Whose| {
        let read = read(&table.path(), &settings, whose, &[false, true], Bound::TARGETS);
        read.unwrap().rows.rows.len()
    };
    assert_eq!((rows(&of_robot("7")), rows(&Whose::default())), (2, 4));
}

#[test]
fn a_column_that_is_not_there_is_told_with_its_key() {
    let table = Table::new("a,s,x,y,z,sd,u,v,w,r\n1,2,3,4,5,6,7,8,9,10\n");
    let told = table.read(&WIDE.replace("\"z - 1\"", "\"zz - 1\""), None).unwrap_err();
    assert!(
        told.contains("measured.csv") && told.contains("[stations] measured.position = \"zz - 1\""),
        "{told}"
    );
    let told = table.read(&WIDE.replace("\"z - 1\"", "\"1 - 2\""), None).unwrap_err();
    assert!(told.contains("names no column"), "{told}");
    // A text in the only row: the error names line and column.
    let table = Table::new("a,s,x,y,z,sd,u,v,w,r\nnone,2,3,4,5,6,7,8,9,10\n");
    let told = table.read(WIDE, None).unwrap_err();
    assert!(told.contains("0 of its 1 rows") && told.contains("line 2, column \"a\""), "{told}");
    // Angles in degrees that are stated as rad leave no reading.
    let table = Table::new("a,s,x,y,z,u,v,w\n1,2,3,4,5,90,8,-170\n");
    let turned = "joints = [\"a\", \"s\"]\njoint_unit = \"deg\"\nlength_unit = \"m\"\n[measured]\nposition = [\"x\", \"y\", \"z\"]\n\
                  unit = \"m\"\norientation = { angles = [\"u\", \"v\", \"w\"], order = \"fixed-xyz\", unit = \"rad\" }\n";
    let told = table.read(turned, None);
    let told = told.unwrap_err();
    assert!(
        told.contains("0 of its 1 rows") && told.contains("170.0 rad, more than two turns"),
        "{told}"
    );
}

#[test]
fn what_is_written_is_read_by_the_section_in_its_head() {
    let file: crate::kinematics::RobotFile =
        toml::from_str(include_str!("../../../pipelines/robots/ur10.toml")).unwrap();
    let arm = file.arm().unwrap();
    let home: Vec<f64> = arm.home().unwrap().to_vec();
    let poses = posegrid_numerics::simulate::Poses::Joints {
        count: 12,
        lower: home.iter().map(|q| q - 0.5).collect(),
        upper: home.iter().map(|q| q + 0.5).collect(),
    };
    let settings = posegrid_numerics::simulate::SimulateSettings::realistic(3, home, poses);
    let simulated = posegrid_numerics::simulate::simulate(&arm, &settings).unwrap();
    let stations = simulated.stations_with(&[nalgebra::Vector3::new(120.0, 0.0, 0.0)]);
    let names = ["T1".to_owned(), "T2".to_owned()];
    let text = csv(&stations, &arm, super::Read { targets: &names, ..super::Read::default() });
    let lines = text.lines().skip(1);
    let section: Vec<&str> = lines.map_while(|line| line.strip_prefix("# ")).collect();
    let section = section.join("\n");
    let table = Table::new(&text);
    let settings: toml::Table = toml::from_str(&section).unwrap();
    let settings: StationsSettings = settings["stations"].clone().try_into().unwrap();
    let read =
        read(&table.path(), &settings, &Whose::default(), &[false; 6], Bound::TARGETS).unwrap();
    assert_eq!(read.rows.rows.len(), stations.len());
    for (row, station) in read.rows.rows.iter().zip(&stations) {
        let away =
            row.joints.iter().zip(&station.joints).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(away < 1e-8, "{away}");
        assert_eq!(row.readings.len(), station.readings.len());
        for (own, reading) in row.readings.iter().zip(&station.readings) {
            assert_eq!((own.target, own.samples), (reading.target, reading.kept));
            let away_mm =
                (own.value.point().unwrap().position - reading.position().unwrap()).norm();
            assert!(away_mm < 1e-6, "{away_mm}");
        }
    }
}
