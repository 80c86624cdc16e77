//! The kind of a file that is no MCAP log, by its first bytes, and advice on what to do with it.

/// A guess with advice, after a blank; empty where nothing is known.
pub(super) fn what_it_is(start: &[u8]) -> &'static str {
    match start {
        [b'#', b'R', b'O', b'S', b'B', b'A', b'G', ..] => {
            " (a ROS 1 bag: `mcap convert in.bag out.mcap` writes a log whose ros1 messages are read)"
        }
        [b'S', b'Q', b'L', b'i', b't', b'e', ..] => {
            " (a SQLite file, as rosbag2 writes with storage sqlite3: `ros2 bag convert` with storage_id mcap, or `mcap \
             convert in.db3 out.mcap`)"
        }
        [b'v', b'e', b'r', b's', b'i', b'o', b'n', b' ', ..] => {
            " (a pointer of Git LFS, which stands for the log: `git lfs pull` fetches it)"
        }
        [0x1f, 0x8b, ..] => " (a gzip file: decompress it with `gunzip`)",
        [b'B', b'Z', b'h', ..] => " (a bzip2 file: decompress it with `bunzip2`)",
        [0xfd, b'7', b'z', b'X', b'Z', 0, ..] => " (an xz file: decompress it with `unxz`)",
        [0x04, 0x22, 0x4d, 0x18, ..] => " (an lz4 file: decompress it with `lz4 -d`)",
        [0x28, 0xb5, 0x2f, 0xfd, ..] => {
            " (a zstd file in a zstd file: decompress it once with `zstd -d`)"
        }
        [b'P', b'K', 3 | 5, ..] => " (a zip archive: unpack it)",
        [0x89, b'H', b'D', b'F', ..] => {
            " (an HDF5 file: write its samples into an MCAP log, with the Python packages h5py and mcap-ros2-support)"
        }
        [b'P', b'A', b'R', b'1', ..] => {
            " (a Parquet file: write its rows into an MCAP log, with the Python package mcap-ros2-support)"
        }
        [b'U', b'L', b'o', b'g', ..] => " (a PX4 ULog)",
        [b'r', b'o', b's', b'b', b'a', b'g', b'2', ..] => {
            " (the metadata.yaml of a rosbag2 recording: name the .mcap files next to it)"
        }
        [0x89, b'M', b'C', b'A', b'P', ..] => {
            " (an MCAP file of another version, or one that was copied as text and is damaged by it)"
        }
        [b'{' | b'[', ..] if is_text(start) => {
            " (JSON text: write its samples into an MCAP log, with the Python package mcap)"
        }
        _ if !start.is_empty() && start.iter().all(|&byte| byte == 0) => {
            " (zeros: room that a recorder asked for and never wrote into, or a damaged disk)"
        }
        _ if start.len() >= 4 && is_text(start) => {
            " (text, perhaps a CSV export: write its rows into an MCAP log, with the Python package mcap-ros2-support)"
        }
        _ => "",
    }
}

fn is_text(start: &[u8]) -> bool {
    let plain = |byte: &u8| matches!(byte, b'\t' | b'\r' | b'\n' | b' '..=b'~');
    // Some exports begin with a byte order mark.
    let start = start.strip_prefix(&[0xef, 0xbb, 0xbf]).unwrap_or(start);
    start.iter().all(plain)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_known_by_their_first_bytes() {
        for (start, word) in [
            (&b"#ROSBAG "[..], "ROS 1"),
            (b"SQLite f", "db3"),
            (b"version ", "git lfs pull"),
            (b"\x1f\x8b\x08\0\0\0\0\0", "gunzip"),
            (b"\x89HDF\r\n\x1a\n", "HDF5"),
            (b"time,x,y", "CSV"),
            (b"\xef\xbb\xbftime,", "CSV"),
            (b"{\"a\":1}\n", "JSON"),
            (b"\0\0\0\0\0\0\0\0", "zeros"),
            (b"\x89MCAP1\r\n", "another version"),
            (b"rosbag2_", "metadata.yaml"),
        ] {
            assert!(what_it_is(start).contains(word), "{start:?}");
        }
        assert_eq!(what_it_is(b"\x89PNG\r\n\x1a\n"), "");
        assert_eq!(what_it_is(b""), "");
    }
}
