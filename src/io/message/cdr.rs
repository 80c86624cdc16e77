//! ROS 2 CDR: a message's bytes, read by a plan.
//!
//! Layout (OMG DDS-XTypes, extended CDR version 1, plain): four bytes of encapsulation, of which the second tells the
//! byte order; then the fields, each number aligned to its own size counted from the end of the encapsulation;
//! strings and sequences begin with a count of four bytes, a string's count includes its end mark.

use thiserror::Error;

use super::cdr_plan::Step;
use super::value::{number, without_end_mark};
use super::{CdrPlan, Numbers, Primitive, Texts, Value};

/// Why one message could not be read.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Error)]
pub enum MessageFault {
    /// It ends inside a field.
    #[error("the message ends before its last field")]
    Short,
    /// Bytes are left after the last field.
    #[error(
        "the message goes on after its last field: its schema is of another version, or bytes are damaged"
    )]
    LeftOver,
    /// Not plain CDR version 1.
    #[error("the message's CDR encapsulation is 0x{0:04x}; read are 0x0000 and 0x0001 (plain CDR)")]
    Encapsulation(u16),
}

/// Where reading stands, counted from the end of the encapsulation.
struct Cursor<'m> {
    bytes: &'m [u8],
    at: usize,
    big_endian: bool,
}

impl CdrPlan {
    /// Lends the wanted values of one message, in the order they were asked for.
    ///
    /// `values` has a place for each wanted path. What was lent before a fault was met must not be used.
    pub fn read<'m>(
        &self,
        message: &'m [u8],
        values: &mut [Value<'m>],
    ) -> Result<(), MessageFault> {
        debug_assert_eq!(values.len(), self.wanted, "a place for each wanted path");
        let (header, bytes) = message
            .split_first_chunk::<4>()
            .ok_or(MessageFault::Short)?;
        let encapsulation = u16::from_be_bytes([header[0], header[1]]);
        if encapsulation > 1 {
            return Err(MessageFault::Encapsulation(encapsulation));
        }
        let mut cursor = Cursor {
            bytes,
            at: 0,
            big_endian: encapsulation == 0,
        };
        cursor.run(&self.steps, values)?;
        cursor.finish()
    }
}

impl<'m> Cursor<'m> {
    fn run(&mut self, steps: &[Step], values: &mut [Value<'m>]) -> Result<(), MessageFault> {
        for step in steps {
            match *step {
                Step::Skip { of, count } => self.elements(of, u64::from(count)).map(drop)?,
                Step::SkipSequence(of) => {
                    let count = self.count()?;
                    self.elements(of, u64::from(count))?;
                }
                Step::SkipText => self.text().map(drop)?,
                Step::Repeat { count, ref steps } => {
                    for _ in 0..self.count_or(count)? {
                        self.run(steps, values)?;
                    }
                }
                Step::Number { slot, of } => {
                    values[slot] = number(self.elements(of, 1)?, of, self.big_endian);
                }
                Step::Text { slot } => values[slot] = Value::Text(self.text()?),
                Step::Numbers { slot, of, count } => {
                    let count = self.count_or(count)?;
                    values[slot] = Value::Numbers(Numbers {
                        bytes: self.elements(of, u64::from(count))?,
                        of,
                        big_endian: self.big_endian,
                    });
                }
                Step::Texts { slot, count } => values[slot] = Value::Texts(self.texts(count)?),
            }
        }
        Ok(())
    }

    /// The bytes of `count` numbers. An empty array is not aligned: nothing is written for it.
    #[inline]
    fn elements(&mut self, of: Primitive, count: u64) -> Result<&'m [u8], MessageFault> {
        if count == 0 {
            return Ok(&[]);
        }
        let size = of.size();
        let start = self.at.next_multiple_of(size);
        let bytes = usize::try_from(count)
            .ok()
            .and_then(|count| count.checked_mul(size))
            .and_then(|length| start.checked_add(length))
            .and_then(|end| self.bytes.get(start..end))
            .ok_or(MessageFault::Short)?;
        self.at = start + bytes.len();
        Ok(bytes)
    }

    fn count(&mut self) -> Result<u32, MessageFault> {
        let start = self.at.next_multiple_of(4);
        let bytes = self
            .bytes
            .get(start..)
            .and_then(|rest| rest.first_chunk::<4>())
            .ok_or(MessageFault::Short)?;
        self.at = start + 4;
        Ok(if self.big_endian {
            u32::from_be_bytes(*bytes)
        } else {
            u32::from_le_bytes(*bytes)
        })
    }

    fn count_or(&mut self, fixed: Option<u32>) -> Result<u32, MessageFault> {
        fixed.map_or_else(|| self.count(), Ok)
    }

    fn text(&mut self) -> Result<&'m [u8], MessageFault> {
        let length = self.count()?;
        self.elements(Primitive::U8, u64::from(length))
            .map(without_end_mark)
    }

    fn texts(&mut self, fixed: Option<u32>) -> Result<Texts<'m>, MessageFault> {
        let count = self.count_or(fixed)?;
        let start = self.at.next_multiple_of(4);
        for _ in 0..count {
            self.text()?;
        }
        Ok(Texts {
            bytes: self.bytes.get(start..self.at).unwrap_or_default(),
            count: usize::try_from(count).map_err(|_| MessageFault::Short)?,
            big_endian: self.big_endian,
        })
    }

    /// Some writers fill a message up to a multiple of four, or with zeros.
    fn finish(&self) -> Result<(), MessageFault> {
        let rest = self.bytes.get(self.at..).unwrap_or_default();
        if rest.len() < 4 || rest.iter().all(|&byte| byte == 0) {
            Ok(())
        } else {
            Err(MessageFault::LeftOver)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::ros2msg::parse;
    use super::*;

    const JOINTS: &str = "Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\n\
        ===\nMSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id";

    fn plan(text: &str, wanted: &[&str]) -> CdrPlan {
        CdrPlan::resolve(&parse("a/B", text).expect("sound text"), wanted).expect("fields exist")
    }

    /// Stamp 7 s 9 ns, frame "b", names "j" and "kk", positions 1.5 and -2, no velocities.
    fn joint_message(little: bool) -> Vec<u8> {
        let mut bytes = vec![0, u8::from(little), 0, 0];
        let word = |n: u32| {
            if little {
                n.to_le_bytes()
            } else {
                n.to_be_bytes()
            }
        };
        let double = |x: f64| {
            if little {
                x.to_le_bytes()
            } else {
                x.to_be_bytes()
            }
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
        let plan = plan(
            JOINTS,
            &["position", "name", "header.stamp.sec", "header.frame_id"],
        );
        for little in [true, false] {
            let message = joint_message(little);
            let mut values = [Value::Unread; 4];
            plan.read(&message, &mut values).expect("sound message");
            let Value::Numbers(position) = values[0] else {
                panic!("numbers")
            };
            assert_eq!(
                (position.get(0), position.get(1), position.get(2)),
                (Some(1.5), Some(-2.0), None)
            );
            let Value::Texts(names) = values[1] else {
                panic!("texts")
            };
            assert_eq!(names.iter().collect::<Vec<_>>(), [&b"j"[..], b"kk"]);
            assert_eq!(values[2], Value::Integer(7));
            assert_eq!(values[3], Value::Text(b"b"));
        }
    }

    #[test]
    fn every_cut_is_a_short_message() {
        let plan = plan(JOINTS, &["position"]);
        let message = joint_message(true);
        for length in 0..message.len() {
            assert_eq!(
                plan.read(&message[..length], &mut [Value::Unread]),
                Err(MessageFault::Short),
                "cut to {length}"
            );
        }
    }

    #[test]
    fn what_follows_the_last_field_must_be_padding() {
        let plan = plan(JOINTS, &["position"]);
        let with = |tail: &[u8]| [&joint_message(true)[..], tail].concat();
        assert_eq!(plan.read(&with(&[1, 2, 3]), &mut [Value::Unread]), Ok(()));
        assert_eq!(plan.read(&with(&[0; 8]), &mut [Value::Unread]), Ok(()));
        assert_eq!(
            plan.read(&with(&[0, 0, 0, 0, 1]), &mut [Value::Unread]),
            Err(MessageFault::LeftOver)
        );
    }

    #[test]
    fn lying_counts_and_strange_encapsulations_are_refused() {
        let plan = plan(JOINTS, &["position"]);
        let mut message = joint_message(true);
        message[4 + 36..4 + 40].copy_from_slice(&u32::MAX.to_le_bytes());
        assert_eq!(
            plan.read(&message, &mut [Value::Unread]),
            Err(MessageFault::Short)
        );
        message[1] = 3;
        assert_eq!(
            plan.read(&message, &mut [Value::Unread]),
            Err(MessageFault::Encapsulation(3))
        );
    }

    #[test]
    fn nested_arrays_and_small_numbers_are_walked() {
        let text = "Inner[] list\nuint8[3] rgb\nint16 wanted\nuint64 big\nfloat32 single\nbool yes\n\
            ===\nMSG: a/Inner\nuint8 a\nstring[2] words\nfloat64 x";
        let plan = plan(text, &["wanted", "big", "single", "yes", "rgb"]);
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
        let mut values = [Value::Unread; 5];
        plan.read(&message, &mut values).expect("sound message");
        assert_eq!(values[0], Value::Integer(-4));
        assert_eq!(values[1], Value::Number(u64::MAX as f64));
        assert_eq!(values[2], Value::Number(0.25));
        assert_eq!(values[3].integer(), Some(1));
        let Value::Numbers(rgb) = values[4] else {
            panic!("numbers")
        };
        assert_eq!(rgb.get(2), Some(3.0));
    }

    #[test]
    fn plans_refuse_what_cannot_be_read() {
        let definition = |text| parse("a/B", text).expect("sound text");
        let refusal = |text, path| {
            CdrPlan::resolve(&definition(text), &[path])
                .expect_err("refused")
                .to_string()
        };
        assert!(refusal("float64 x\nfloat64 y", "z").contains("x, y"));
        assert!(refusal("B b", "b.x").contains("contains itself"));
        assert!(refusal("C c\n===\nMSG: a/C\nfloat64 x", "c").contains("message"));
        assert!(refusal("wstring w\nfloat64 x", "x").contains("wstring"));
    }
}
