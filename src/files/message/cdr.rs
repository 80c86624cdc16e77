//! ROS 2 CDR, and ROS 1's serialization: a message's bytes, read by a reader.
//!
//! Layout of CDR (OMG DDS-XTypes 1.3, 7.4): four bytes of encapsulation, of which the second states version, byte order
//! and whether messages are delimited; then the fields, each number aligned to its own size (in version 2 to 4 at most)
//! from the end of the encapsulation; strings and sequences begin with a count of four bytes, a string's includes its
//! terminating zero. In version 2 an array of anything but numbers begins with its length in bytes; in the delimited
//! encoding each appendable message does so too.
//!
//! Layout of ROS 1 (wiki, "msg"): the fields, little-endian and unaligned; a string's count includes no terminating
//! zero; a message without fields has no bytes.
//!
//! Characters of wide strings have four bytes in Fast DDS, two in Cyclone DDS, and no message states which: such a
//! message is read both ways, and used when only one fits, or both give the same values. A message with the same layout
//! as the one before is not walked again ([`layout`]).

mod layout;

use super::cdr_reader::{Repeat, Step};
use super::cell::{Cell, Span, number, place};
use super::value::TextForm;
use super::{CdrReader, Decoded, MessageFault, Primitive, Row, Serialization};

pub(super) use layout::Layout;

const WIDE: [u8; 2] = [4, 2];

/// The reading position, with what the encoding states for the whole message.
struct Cursor<'m> {
    bytes: &'m [u8],
    at: usize,
    big_endian: bool,
    texts: TextForm,
    /// Bytes to which the largest numbers are aligned.
    widest: usize,
    version_2: bool,
    wide: u8,
    layout: Layout,
}

impl CdrReader {
    /// The wanted values of one message go into the row, in their order; after a fault they must not be used.
    pub fn read(&self, message: &[u8], row: &mut Row) -> Decoded<()> {
        if row.fill_as_before(&self.identity, message) {
            return Ok(());
        }
        row.begin(message, self.wanted)?;
        if !self.wide {
            return self.read_as(message, WIDE[0], row);
        }
        let first = self.read_as(message, WIDE[0], row);
        let mut other = Row::default();
        other.begin(message, self.wanted)?;
        match (first, self.read_as(message, WIDE[1], &mut other)) {
            (Ok(()), Ok(())) if !row.says_same(&other) => Err(MessageFault::WideText),
            (Ok(()), _) => Ok(()),
            (Err(_), Ok(())) => {
                other.instead_of(row);
                Ok(())
            }
            (Err(fault), Err(_)) => Err(fault),
        }
    }

    fn read_as(&self, message: &[u8], wide: u8, row: &mut Row) -> Decoded<()> {
        let (steps, mut cursor) = self.begin(message, wide, std::mem::take(&mut row.layout))?;
        cursor.run(steps, row)?;
        cursor.finish()?;
        if !self.wide && !row.listed {
            cursor.layout.keep(&self.identity, message, cursor.big_endian);
        }
        row.layout = cursor.layout;
        Ok(())
    }

    /// The steps over a message in its encoding, and the position of its first field.
    fn begin<'m>(
        &self,
        message: &'m [u8],
        wide: u8,
        layout: Layout,
    ) -> Decoded<(&[Step], Cursor<'m>)> {
        let mut packed = Cursor {
            bytes: message,
            at: 0,
            big_endian: false,
            texts: TextForm::Packed,
            widest: 1,
            version_2: false,
            wide,
            layout,
        };
        if self.serialization == Serialization::Ros1 {
            return Ok((&self.plain, packed));
        }
        let (header, _) = message.split_first_chunk::<HEADER>().ok_or(MessageFault::Short)?;
        let encapsulation = u16::from_be_bytes([header[0], header[1]]);
        // Even numbers are big-endian. Numbers from 0x10 on are those of an earlier edition of the standard.
        let (steps, version_2) = match encapsulation {
            0 | 1 => (&self.plain, false),
            6 | 7 | 0x10 | 0x11 => (&self.plain, true),
            8 | 9 | 0x14 | 0x15 => (&self.delimited, true),
            other => return Err(MessageFault::Encapsulation(other)),
        };
        let big_endian = encapsulation % 2 == 0;
        packed.layout.count(0);
        let cursor = Cursor {
            at: HEADER,
            big_endian,
            texts: if big_endian { TextForm::BigEndian } else { TextForm::LittleEndian },
            widest: if version_2 { 4 } else { 8 },
            version_2,
            ..packed
        };
        Ok((steps, cursor))
    }
}

/// Bytes of CDR's encapsulation, from the end of which alignment is counted.
const HEADER: usize = 4;

impl Cursor<'_> {
    fn run(&mut self, steps: &[Step], row: &mut Row) -> Decoded<()> {
        for step in steps {
            match *step {
                Step::Skip { of, count } => self.elements(of, u64::from(count)).map(drop)?,
                Step::SkipSequence(of) => {
                    let count = self.count()?;
                    self.elements(of, u64::from(count))?;
                }
                Step::SkipText => self.text().map(drop)?,
                Step::SkipWideText => self.wide_text()?,
                Step::Repeat(ref repeat) => self.collection(|cursor| cursor.repeat(repeat, row))?,
                Step::Delimited(ref steps) => self.delimited(|cursor| cursor.run(steps, row))?,
                Step::Number { slot, of } => {
                    row.set(slot, self.number(of)?);
                    self.layout.number(self.at - of.size(), slot, of);
                }
                Step::Text { slot } => row.set(slot, Cell::Text(self.text()?)),
                Step::AddNumber { slot, of } => row.list(slot).set_last(self.number(of)?),
                Step::AddText { slot } => row.list(slot).set_last(Cell::Text(self.text()?)),
                Step::Numbers { slot, of, count } => {
                    let count = self.count_or(count)?;
                    let (start, end) = self.elements(of, u64::from(count))?;
                    let (start, end, big_endian) = (place(start), place(end), self.big_endian);
                    row.set(slot, Cell::Numbers { start, end, of, big_endian });
                }
                Step::Texts { slot, count } => {
                    self.collection(|cursor| {
                        row.set(slot, cursor.texts(count)?);
                        Ok(())
                    })?;
                }
                Step::Pick { of, count, ref picks, each } => {
                    let count = self.count_or(count)?;
                    let (start, end) = self.elements(of, u64::from(count))?;
                    let elements = &self.bytes[start..end];
                    for &(index, slot) in picks {
                        let element = elements.chunks_exact(of.size()).nth(index);
                        let cell = element.map(|bytes| number(bytes, of, self.big_endian));
                        if each {
                            row.list(slot).set_last(cell.unwrap_or_default());
                            continue;
                        }
                        if cell.is_some() {
                            self.layout.number(start + index * of.size(), slot, of);
                        }
                        row.set(slot, cell.unwrap_or_default());
                    }
                }
            }
        }
        Ok(())
    }

    fn repeat(&mut self, repeat: &Repeat, row: &mut Row) -> Decoded<()> {
        let count = self.count_or(repeat.count)?;
        for &slot in &repeat.lists {
            row.list(slot);
        }
        let mut picked = repeat.picked.iter().peekable();
        for index in 0..count {
            // Each element has at least one byte, so a wrong count ends here.
            if self.at >= self.bytes.len() {
                return Err(MessageFault::Short);
            }
            for &slot in &repeat.lists {
                row.list(slot).begin_element()?;
            }
            let here = picked.next_if(|(picked, _)| u32::try_from(*picked) == Ok(index));
            self.run(here.map_or(&repeat.steps, |(_, steps)| steps), row)?;
        }
        Ok(())
    }

    /// Reads an array of anything but numbers: in version 2 it begins with its length in bytes.
    fn collection(&mut self, read: impl FnOnce(&mut Self) -> Decoded<()>) -> Decoded<()> {
        if self.version_2 { self.delimited(read) } else { read(self) }
    }

    /// Reads a part that begins with its length in bytes; unread bytes of it are skipped.
    fn delimited(&mut self, read: impl FnOnce(&mut Self) -> Decoded<()>) -> Decoded<()> {
        let length = usize::try_from(self.count()?).map_err(|_| MessageFault::Short)?;
        let whole = self.bytes;
        let end = self.at.checked_add(length).ok_or(MessageFault::Short)?;
        self.bytes = whole.get(..end).ok_or(MessageFault::Short)?;
        let result = read(self);
        (self.bytes, self.at) = (whole, end);
        result
    }

    fn number(&mut self, of: Primitive) -> Decoded<Cell> {
        let (start, end) = self.elements(of, 1)?;
        Ok(number(&self.bytes[start..end], of, self.big_endian))
    }

    /// The byte range of `count` numbers. An empty array is not aligned: nothing is written for it.
    #[inline]
    fn elements(&mut self, of: Primitive, count: u64) -> Decoded<(usize, usize)> {
        if count == 0 {
            return Ok((self.at, self.at));
        }
        let size = of.size();
        let start = self.aligned(size);
        let end = usize::try_from(count)
            .ok()
            .and_then(|count| count.checked_mul(size))
            .and_then(|length| start.checked_add(length))
            .filter(|&end| end <= self.bytes.len())
            .ok_or(MessageFault::Short)?;
        self.at = end;
        Ok((start, end))
    }

    #[inline]
    fn aligned(&self, size: usize) -> usize {
        let size = size.min(self.widest);
        // Counted from as many bytes before the message, which is the same for up to twice as many.
        ((self.at + HEADER + size - 1) & !(size - 1)) - HEADER
    }

    fn count(&mut self) -> Decoded<u32> {
        let start = self.aligned(4);
        let bytes = self
            .bytes
            .get(start..)
            .and_then(|rest| rest.first_chunk::<4>())
            .ok_or(MessageFault::Short)?;
        self.at = start + 4;
        self.layout.count(start);
        Ok(if self.big_endian { u32::from_be_bytes(*bytes) } else { u32::from_le_bytes(*bytes) })
    }

    fn count_or(&mut self, fixed: Option<u32>) -> Decoded<u32> {
        fixed.map_or_else(|| self.count(), Ok)
    }

    fn text(&mut self) -> Decoded<Span> {
        let length = self.count()?;
        let (start, end) = self.elements(Primitive::U8, u64::from(length))?;
        self.layout.text(end);
        let length = self.texts.characters(&self.bytes[start..end]).len();
        Ok(Span::new(start, start + length, false))
    }

    fn wide_text(&mut self) -> Decoded<()> {
        let length = u64::from(self.count()?);
        self.elements(Primitive::U8, length * u64::from(self.wide)).map(drop)
    }

    fn texts(&mut self, fixed: Option<u32>) -> Decoded<Cell> {
        let count = self.count_or(fixed)?;
        let start = self.aligned(4);
        for _ in 0..count {
            self.text()?;
        }
        let (start, end) = (place(start), place(self.at.max(start)));
        Ok(Cell::Texts { start, end, count, form: self.texts })
    }

    /// Some writers of CDR pad a message to a multiple of four, or with zeros.
    fn finish(&mut self) -> Decoded<()> {
        let rest = self.bytes.get(self.at..).unwrap_or_default();
        let is_padding = rest.len() < 4 || rest.iter().all(|&byte| byte == 0);
        if rest.is_empty() || is_padding && self.texts != TextForm::Packed {
            if rest.len() >= 4 {
                self.layout.depends_on_more();
            }
            Ok(())
        } else {
            Err(MessageFault::LeftOver)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::rosmsg::parse;
    use super::super::{FieldPath, Value};
    use super::*;

    const JOINTS: &str = "Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\n\
        ===\nMSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id";

    fn paths(wanted: &[&str]) -> Vec<FieldPath> {
        let paths = wanted.iter().map(|path| FieldPath::parse(path));
        paths.collect::<Result<_, _>>().expect("sound paths")
    }

    fn reader(text: &str, wanted: &[&str]) -> CdrReader {
        reader_of(Serialization::Cdr, text, wanted)
    }

    fn reader_of(serialization: Serialization, text: &str, wanted: &[&str]) -> CdrReader {
        let definition = parse("a/B", text, serialization).expect("sound text");
        CdrReader::resolve(&definition, &paths(wanted)).expect("fields exist")
    }

    #[test]
    fn a_reused_row_equals_a_new_one() {
        let wanted = ["header.stamp.sec", "header.stamp.nanosec", "name", "position[1]"];
        let readers = [
            reader(JOINTS, &wanted),
            reader(JOINTS, &["position", "velocity"]),
            reader(JOINTS, &["header.frame_id", "name"]),
        ];
        let mut messages = vec![joint_message(true), joint_message(false)];
        for (at, byte) in [
            (4, 8),      // another stamp
            (16, b'\0'), // the frame's end mark, and the byte before it
            (16, b'c'),
            (32, b'k'), // another name
            (48, 77),   // another position
            (40, 1),    // one position: the rest does not fit any more
            (60, 9),    // a velocity that is not there
            (1, 7),     // version 2, in which numbers lie elsewhere
        ] {
            let mut message = joint_message(true);
            message[at] = byte;
            messages.push(message);
        }
        messages.push([joint_message(true), vec![0; 8]].concat());
        messages.push([joint_message(true), vec![0, 0, 0, 0, 1, 0, 0, 0]].concat());
        messages.push(joint_message(true)[..40].to_vec());
        let mut again = Row::default();
        for (first, second) in
            (0..messages.len()).flat_map(|i| (0..messages.len()).map(move |j| (i, j)))
        {
            for (reader, then) in [(0, 0), (0, 1), (1, 1), (2, 2), (1, 0)] {
                let mut fresh = Row::default();
                let (reader, then) = (&readers[reader], &readers[then]);
                let _ = reader.read(&messages[first], &mut again);
                for message in [&messages[second], &messages[second]] {
                    let found = then.read(message, &mut again);
                    assert_eq!(found, then.read(message, &mut fresh), "{first} {second}");
                    assert!(found.is_err() || again.says_same(&fresh), "{first} {second}");
                    fresh = Row::default();
                }
            }
        }
    }

    fn fault(reader: &CdrReader, message: &[u8]) -> Decoded<()> {
        reader.read(message, &mut Row::default())
    }

    /// Stamp 7 s 9 ns, frame "b", names "j" and "kk", positions 1.5 and -2, no velocities.
    fn joint_message(little: bool) -> Vec<u8> {
        let mut bytes = vec![0, u8::from(little), 0, 0];
        let word = |n: u32| {
            if little { n.to_le_bytes() } else { n.to_be_bytes() }
        };
        let double = |x: f64| {
            if little { x.to_le_bytes() } else { x.to_be_bytes() }
        };
        bytes.extend(word(7)); // 0: sec
        bytes.extend(word(9)); // 4: nanosec
        bytes.extend(word(2)); // 8: "b" and its end mark
        bytes.extend(b"b\0\xAA\xAA"); // 12, padding need not be zero
        bytes.extend(word(2)); // 16: two names
        bytes.extend(word(2)); // 20
        bytes.extend(b"j\0\0\0"); // 24
        bytes.extend(word(3)); // 28
        bytes.extend(b"kk\0\0"); // 32
        bytes.extend(word(2)); // 36: two positions, at 40, a multiple of 8
        bytes.extend(double(1.5));
        bytes.extend(double(-2.0));
        bytes.extend(word(0)); // 56: no velocities, and no alignment for none
        bytes
    }

    #[test]
    fn both_byte_orders_lend_the_same_values() {
        let reader = reader(JOINTS, &["position", "name", "header.stamp.sec", "header.frame_id"]);
        for little in [true, false] {
            let message = joint_message(little);
            let mut row = Row::default();
            reader.read(&message, &mut row).expect("sound message");
            let value = |slot| row.value(&message, slot);
            let position = value(0).numbers().expect("numbers");
            assert_eq!(
                (position.get(0), position.get(1), position.get(2)),
                (Some(1.5), Some(-2.0), None)
            );
            let names = value(1).texts().expect("texts");
            let names: Vec<_> = names.iter().map(|name| name.expect("a text").to_text()).collect();
            assert_eq!(names, ["j", "kk"]);
            assert_eq!(value(2), Value::Integer(7));
            assert!(matches!(value(3), Value::Text(text) if text.is("b")));
        }
    }

    #[test]
    fn every_cut_is_a_short_message() {
        let reader = reader(JOINTS, &["position"]);
        let message = joint_message(true);
        for length in 0..message.len() {
            assert_eq!(
                fault(&reader, &message[..length]),
                Err(MessageFault::Short),
                "cut to {length}"
            );
        }
    }

    #[test]
    fn what_follows_the_last_field_must_be_padding() {
        let reader = reader(JOINTS, &["position"]);
        let with = |tail: &[u8]| [&joint_message(true)[..], tail].concat();
        assert_eq!(fault(&reader, &with(&[1, 2, 3])), Ok(()));
        assert_eq!(fault(&reader, &with(&[0; 8])), Ok(()));
        assert_eq!(fault(&reader, &with(&[0, 0, 0, 0, 1])), Err(MessageFault::LeftOver));
    }

    #[test]
    fn lying_counts_and_strange_encapsulations_are_refused() {
        let reader = reader(JOINTS, &["position"]);
        let mut message = joint_message(true);
        message[4 + 36..4 + 40].copy_from_slice(&u32::MAX.to_le_bytes());
        assert_eq!(fault(&reader, &message), Err(MessageFault::Short));
        for parameter_list in [2, 3, 0xA, 0xB] {
            message[1] = parameter_list;
            assert_eq!(
                fault(&reader, &message),
                Err(MessageFault::Encapsulation(parameter_list.into()))
            );
        }
    }

    const ROS_1: &str = "Header header\nduration left\nbyte b\nchar c\nbool d\nNone[] nothing\nNone[7] never\n\
        string[] name\nfloat64[] position\nPair[] pairs\n===\nMSG: a/None\nuint8 NOT=1\n===\nMSG: a/Pair\nint16 x\nstring s";

    /// Sequence number 3, stamp 7 s 9 ns, frame "b", duration −2 s 5 ns, bytes 255, 254 and 1, names "j" and "k\0",
    /// positions 1.5 and −2, pairs of −1 and "p", 2 and "".
    fn ros_1_message() -> Vec<u8> {
        let mut bytes = Vec::new();
        for n in [3_u32, 7, 9, 1] {
            bytes.extend(n.to_le_bytes());
        }
        bytes.extend(b"b\xFE\xFF\xFF\xFF\x05\0\0\0"); // 16: the frame without end mark; 17: duration
        bytes.extend([255, 254, 1]); // 25: byte, char, bool
        bytes.extend([9, 0, 0, 0]); // 28: nine elements without fields
        bytes.extend(b"\x02\0\0\0\x01\0\0\0j\x02\0\0\0k\0"); // 32: names
        bytes.extend([2, 0, 0, 0]); // 47
        bytes.extend([1.5_f64, -2.0].into_iter().flat_map(f64::to_le_bytes)); // 51
        bytes.extend(b"\x02\0\0\0\xFF\xFF\x01\0\0\0p\x02\0\0\0\0\0"); // 67: pairs
        bytes
    }

    #[test]
    fn ros_1_has_neither_alignment_nor_end_marks() {
        let wanted = [
            "header.seq",
            "header.stamp.sec|secs",
            "header.stamp.nsecs",
            "left.secs",
            "b",
            "c",
            "d",
            "position[1]",
            "pairs[0].x",
            "pairs[].s",
            "name",
            "header.frame_id",
        ];
        let reader = reader_of(Serialization::Ros1, ROS_1, &wanted);
        let message = ros_1_message();
        let mut row = Row::default();
        reader.read(&message, &mut row).expect("sound message");
        let integers = [0, 1, 2, 3, 4, 5, 6, 8].map(|slot| row.value(&message, slot).integer());
        assert_eq!(integers, [3, 7, 9, -2, -1, 254, 1, -1].map(Some));
        assert_eq!(row.value(&message, 7), Value::Number(-2.0));
        let texts = |slot| {
            let texts = row.value(&message, slot).texts().expect("an array");
            texts.iter().map(|text| text.expect("a text").to_text()).collect::<Vec<_>>()
        };
        assert_eq!(
            (texts(9), texts(10)),
            (vec!["p".to_owned(), String::new()], vec!["j".to_owned(), "k\0".to_owned()])
        );
        assert!(matches!(row.value(&message, 11), Value::Text(text) if text.is("b")));
    }

    #[test]
    fn a_ros_1_message_ends_where_its_fields_end() {
        let reader = reader_of(Serialization::Ros1, ROS_1, &["position"]);
        let message = ros_1_message();
        for length in 0..message.len() {
            assert_eq!(fault(&reader, &message[..length]), Err(MessageFault::Short), "{length}");
        }
        assert_eq!(fault(&reader, &[&message[..], &[0]].concat()), Err(MessageFault::LeftOver));
        for count in [12, 32, 36, 47, 67] {
            let mut message = message.clone();
            message[count..count + 4].fill(0xFF);
            assert_eq!(fault(&reader, &message), Err(MessageFault::Short), "{count}");
        }
        let empty = reader_of(Serialization::Ros1, "", &[]);
        assert_eq!(fault(&empty, &[]), Ok(()));
    }

    #[test]
    fn a_row_of_ros_1_is_reused_whatever_the_sequence_number() {
        let wanted = ["header.seq", "header.stamp.secs", "name", "position[1]"];
        let reader = reader_of(Serialization::Ros1, ROS_1, &wanted);
        let mut row = Row::default();
        reader.read(&ros_1_message(), &mut row).expect("sound message");
        let filled = row.filled();
        let mut next = ros_1_message();
        next[0] = 4; // the sequence number
        next[51 + 15] = 0x40; // the second position, now 2
        reader.read(&next, &mut row).expect("sound message");
        assert_eq!(row.filled(), filled, "it was not walked again");
        assert_eq!((row.integer(0), row.number(3)), (Some(4), Some(2.0)));
        next[40] = b'i'; // another name
        reader.read(&next, &mut row).expect("sound message");
        assert_ne!(row.filled(), filled);
    }

    #[test]
    fn elements_of_an_array_in_each_are_gathered() {
        let text = "Joint[] joints\n===\nMSG: a/Joint\nuint8 axis\nfloat32[3] c\nfloat32[] d";
        let reader = reader(text, &["joints[].c[0]", "joints[].c[2]", "joints[].d[1]"]);
        let mut message = vec![0, 1, 0, 0];
        message.extend(2_u32.to_le_bytes()); // 0: two joints
        for (axis, d) in [(7, &[0.5_f32, 1.5][..]), (8, &[2.5][..])] {
            message.extend([axis, 0, 0, 0]); // axis and padding
            for own in [1.0_f32, 2.0, f32::from(axis)] {
                message.extend(own.to_le_bytes());
            }
            message.extend(u32::try_from(d.len()).expect("few").to_le_bytes());
            for own in d {
                message.extend(own.to_le_bytes());
            }
        }
        let mut row = Row::default();
        reader.read(&message, &mut row).expect("sound message");
        let gathered = |slot| {
            let list = row.value(&message, slot).numbers().expect("an array");
            [list.get(0), list.get(1)]
        };
        assert_eq!(gathered(0), [Some(1.0), Some(1.0)]);
        assert_eq!(gathered(1), [Some(7.0), Some(8.0)]);
        // The second joint has no second d.
        assert_eq!(gathered(2), [Some(1.5), None]);
    }

    #[test]
    fn elements_are_picked_and_fields_of_each_are_gathered() {
        let text = "float32[] q\nJoint[] joints\n===\nMSG: a/Joint\nstring name\nuint8 axis\nfloat64 angle";
        let reader = reader(
            text,
            &[
                "q[1]",
                "q[2]",
                "joints[].name",
                "joints[].angle",
                "joints[1].axis",
                "joints[2].axis",
            ],
        );
        let mut message = vec![0, 1, 0, 0];
        message.extend(2_u32.to_le_bytes()); // 0: two numbers
        message.extend(0.5_f32.to_le_bytes()); // 4
        message.extend(1.5_f32.to_le_bytes()); // 8
        message.extend(2_u32.to_le_bytes()); // 12: two joints
        message.extend(2_u32.to_le_bytes()); // 16
        message.extend(b"a\0\x07\0"); // 20: "a", axis 7, padding
        message.extend(0.25_f64.to_le_bytes()); // 24
        message.extend(3_u32.to_le_bytes()); // 32
        message.extend(b"bc\0\x09"); // 36: "bc", axis 9
        message.extend(8.5_f64.to_le_bytes()); // 40
        let mut row = Row::default();
        reader.read(&message, &mut row).expect("sound message");
        let value = |slot| row.value(&message, slot);
        // Neither array has a third element.
        assert_eq!((value(0), value(1)), (Value::Number(1.5), Value::Absent));
        let names = value(2).texts().expect("an array");
        let names: Vec<_> = names.iter().map(|name| name.expect("a text").to_text()).collect();
        assert_eq!(names, ["a", "bc"]);
        let angles = value(3).numbers().expect("an array");
        assert_eq!([0, 1, 2].map(|i| angles.get(i)), [Some(0.25), Some(8.5), None]);
        assert_eq!((value(4), value(5)), (Value::Integer(9), Value::Absent));
    }

    /// Version 2: doubles are aligned to 4, collections of anything but numbers begin with their length.
    #[test]
    fn version_2_is_read_plain_and_delimited() {
        let text = "uint8 a\nfloat64 x\nstring[] words\nInner[1] list\nInner one\nfloat64 last\n\
            ===\nMSG: a/Inner\nuint8 b\nfloat64 y";
        let reader = reader(text, &["x", "words", "list[0].y", "one.y", "last"]);
        let word = |n: u32| n.to_le_bytes();
        let inner = |y: f64| [&[7, 0, 0, 0][..], &y.to_le_bytes()].concat();
        let head = [&[1, 0, 0, 0][..], &1.5_f64.to_le_bytes()].concat();
        // One word of one letter: count, length with end mark, letter, end mark.
        let words = [&word(10)[..], &word(1), &word(2), b"w\0\0\0"].concat();
        let last = 4.5_f64.to_le_bytes();
        let plain = [&[0, 7, 0, 0][..], &head, &words, &word(12), &inner(2.5), &inner(3.5), &last];
        // Appendable messages begin with their length; `one` has four bytes more than the schema knows.
        let list = [&word(16)[..], &word(12), &inner(2.5)].concat();
        let one = [&word(16)[..], &inner(3.5), &[9; 4]].concat();
        let body = [&head[..], &words, &list, &one, &last].concat();
        let size = word(u32::try_from(body.len()).expect("small"));
        let delimited = [&[0, 9, 0, 0][..], &size, &body];
        for message in [plain.concat(), delimited.concat()] {
            let mut row = Row::default();
            reader.read(&message, &mut row).expect("sound message");
            let number = |slot| row.value(&message, slot).number();
            assert_eq!([0, 2, 3, 4].map(number), [1.5, 2.5, 3.5, 4.5].map(Some));
            let words = row.value(&message, 1).texts().expect("an array");
            assert!(words.iter().all(|word| word.is_some_and(|word| word.is("w"))));
            for length in 0..message.len() {
                assert!(fault(&reader, &message[..length]).is_err(), "cut to {length}");
            }
        }
    }

    #[test]
    fn wide_strings_are_passed_over_where_one_width_fits() {
        let reader = reader("wstring w\nuint32 x", &["x"]);
        let read = |wide: &[u8], count: u8| {
            let message = [&[0, 1, 0, 0, count, 0, 0, 0][..], wide, &[5, 0, 0, 0]].concat();
            let mut row = Row::default();
            reader.read(&message, &mut row).map(|()| row.value(&message, 0).integer())
        };
        assert_eq!(read(&[], 0), Ok(Some(5)));
        assert_eq!(read(b"a\0\0\0b\0\0\0", 2), Ok(Some(5)));
        assert_eq!(read(b"a\0b\0", 2), Ok(Some(5)));
        // Read with two bytes per character, x is the second character and a zero is left over.
        assert_eq!(
            reader.read(
                &[0, 1, 0, 0, 2, 0, 0, 0, 1, 0, 0, 0, 2, 0, 0, 0, 0, 0, 0, 0],
                &mut Row::default()
            ),
            Err(MessageFault::WideText)
        );
        // Read with two bytes, a character 0 follows, and the remaining bytes look like padding.
        assert_eq!(read(b"a\0\0\0", 1), Ok(Some(5)));
    }

    #[test]
    fn nested_arrays_and_small_numbers_are_walked() {
        let text = "Inner[] list\nuint8[3] rgb\nint16 wanted\nuint64 big\nfloat32 single\nbool yes\n\
            ===\nMSG: a/Inner\nuint8 a\nstring[2] words\nfloat64 x";
        let reader = reader(text, &["wanted", "big", "single", "yes", "rgb"]);
        let mut message = vec![0, 1, 0, 0];
        message.extend(1_u32.to_le_bytes()); // 0: one Inner
        message.extend([5, 0, 0, 0]); // 4: a, padding
        message.extend(1_u32.to_le_bytes()); // 8: ""
        message.extend([0, 0, 0, 0]); // 12: its end mark, padding
        message.extend(2_u32.to_le_bytes()); // 16: "w"
        message.extend(b"w\0\0\0"); // 20, 24 is a multiple of 8
        message.extend(2.5_f64.to_le_bytes()); // 24: x
        message.extend([1, 2, 3, 0]); // 32: rgb, padding
        message.extend((-4_i16).to_le_bytes()); // 36
        message.extend([0, 0]); // 38: padding to 40
        message.extend(u64::MAX.to_le_bytes()); // 40
        message.extend(0.25_f32.to_le_bytes()); // 48
        message.push(1); // 52
        let mut row = Row::default();
        reader.read(&message, &mut row).expect("sound message");
        let value = |slot| row.value(&message, slot);
        assert_eq!(value(0), Value::Integer(-4));
        assert_eq!(value(1), Value::Number(u64::MAX as f64));
        assert_eq!(value(2), Value::Number(0.25));
        assert_eq!(value(3).integer(), Some(1));
        assert_eq!(value(4).numbers().and_then(|rgb| rgb.get(2)), Some(3.0));
    }

    #[test]
    fn plans_refuse_what_cannot_be_read() {
        let definition = |text| parse("a/B", text, Serialization::Cdr).expect("sound text");
        let refusal = |text, path| {
            CdrReader::resolve(&definition(text), &paths(&[path])).expect_err("refused").to_string()
        };
        assert!(refusal("float64 x\nfloat64 y", "z").contains("x, y"));
        assert!(refusal("B b\nfloat64 x", "x").contains("contains itself"));
        assert!(refusal("C c\n===\nMSG: a/C\nfloat64 x", "c").contains("message"));
        assert!(refusal("wstring w\nfloat64 x", "w").contains("wstring"));
        assert!(refusal("float64[3] x", "x[3]").contains("has 3"));
        assert!(refusal("C[] c\n===\nMSG: a/C\nfloat64 x", "c.x").contains("message[]"));
    }
}
