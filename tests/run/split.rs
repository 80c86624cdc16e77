//! Sessions whose recorder split its logs into files: the same stations as from whole logs.

use std::fs;

use super::cell::Cell;

/// A log in two files, cut where its time is halfway: the later one first.
fn halves(log: &[u8]) -> [Vec<u8>; 2] {
    let times = || {
        let messages = mcap::MessageStream::new(log).expect("a log");
        messages.map(|message| message.expect("sound").log_time)
    };
    let middle = times().min().expect("messages").midpoint(times().max().expect("messages"));
    [true, false].map(|late| {
        let mut writer = mcap::Writer::new(std::io::Cursor::new(Vec::new())).expect("in memory");
        for message in mcap::MessageStream::new(log).expect("a log") {
            let message = message.expect("sound");
            if (message.log_time >= middle) == late {
                writer.write(&message).expect("in memory");
            }
        }
        writer.finish().expect("in memory");
        writer.into_inner().into_inner()
    })
}

/// A cell with a session of twelve stations, whole.
fn whole() -> Cell {
    Cell::new().with("harmonics = 12", "enabled = false").with_simulated("mon", &["--random", "12"])
}

/// The same session with each log in two files, one of them in zstd as a whole.
fn split() -> Cell {
    let names = "controller = \"arm_*.mcap*\"\ntracker = [\"laser-b.mcap\", \"laser-a.mcap\"]";
    let cell = whole().with("# sessions", names);
    let folder = cell.session("mon");
    let taken = |log: &str| {
        let path = folder.join(log);
        let bytes = fs::read(&path).expect("a log");
        fs::remove_file(path).expect("writable");
        bytes
    };
    let [late, early] = halves(&taken("controller.mcap"));
    fs::write(folder.join("arm_0.mcap"), late).expect("writable");
    let packed = zstd::stream::encode_all(&early[..], 1).expect("memory");
    fs::write(folder.join("arm_1.mcap.zst"), packed).expect("writable");
    let [late, early] = halves(&taken("tracker.mcap"));
    fs::write(folder.join("laser-a.mcap"), late).expect("writable");
    fs::write(folder.join("laser-b.mcap"), early).expect("writable");
    cell
}

#[test]
fn a_split_session_gives_the_stations_of_the_whole_one() {
    let (split, whole) = (split(), whole());
    for cell in [&split, &whole] {
        // Twelve stations cannot show that 95 % are within tolerance.
        cell.run(&[]).expect(3, &["12 stations, 12 measured"]);
    }
    let [found, expected] = [&split, &whole].map(|cell| cell.table("stations", "mon"));
    assert_eq!(found.rows(), 12);
    for column in ["start_ns", "end_ns"] {
        assert_eq!(found.i64(column), expected.i64(column), "{column}");
    }
    for column in ["x_mm", "y_mm", "z_mm"] {
        assert_eq!(found.f64(column), expected.f64(column), "{column}");
    }
    // The run's name does not follow from its files' names.
    let folder = split.session("mon");
    fs::rename(folder.join("arm_0.mcap"), folder.join("arm_7.mcap")).expect("writable");
    split.run(&[]).expect(3, &["done-before"]);
}

#[test]
fn a_part_that_is_named_twice_or_not_there_is_reported() {
    let cell = split();
    let folder = cell.session("mon");
    fs::copy(folder.join("arm_0.mcap"), folder.join("arm_2.mcap")).expect("writable");
    cell.run(&[]).expect(1, &["mon/controller", "hold the same", "arm_2.mcap"]);
    fs::remove_file(folder.join("laser-a.mcap")).expect("was there");
    let waits = "waits        mon: it has no laser-a.mcap yet";
    cell.run(&[]).expect(0, &[waits, "1 waiting"]);
}
