//! Writes protobuf messages, and descriptor sets, which are protobuf messages too.

/// A message being written.
#[derive(Default, Clone)]
pub struct Proto(pub Vec<u8>);

impl Proto {
    fn tag(&mut self, number: u32, wire_type: u8) {
        self.raw_varint(u64::from(number) << 3 | u64::from(wire_type));
    }

    pub fn raw_varint(&mut self, mut value: u64) {
        while value >= 0x80 {
            self.0.push(value.to_le_bytes()[0] | 0x80);
            value >>= 7;
        }
        self.0.push(value.to_le_bytes()[0]);
    }

    pub fn varint(mut self, number: u32, value: u64) -> Self {
        self.tag(number, 0);
        self.raw_varint(value);
        self
    }

    pub fn double(mut self, number: u32, value: f64) -> Self {
        self.tag(number, 1);
        self.0.extend(value.to_le_bytes());
        self
    }

    pub fn fixed_64(mut self, number: u32, value: u64) -> Self {
        self.tag(number, 1);
        self.0.extend(value.to_le_bytes());
        self
    }

    pub fn fixed_32(mut self, number: u32, value: u32) -> Self {
        self.tag(number, 5);
        self.0.extend(value.to_le_bytes());
        self
    }

    pub fn bytes(mut self, number: u32, value: &[u8]) -> Self {
        self.tag(number, 2);
        self.raw_varint(value.len() as u64);
        self.0.extend(value);
        self
    }

    pub fn message(self, number: u32, inner: &Self) -> Self {
        self.bytes(number, &inner.0)
    }

    pub fn group(mut self, number: u32, inner: &Self) -> Self {
        self.tag(number, 3);
        self.0.extend(&inner.0);
        self.tag(number, 4);
        self
    }
}

/// A field of a descriptor.
pub struct Field<'a> {
    pub name: &'a str,
    pub number: u32,
    pub repeated: bool,
    /// As `descriptor.proto` numbers them: 1 double, 2 float, 9 string, 11 message, …
    pub kind: u64,
    pub type_name: &'a str,
    pub oneof: Option<u64>,
}

impl<'a> Field<'a> {
    pub const fn one(name: &'a str, number: u32, kind: u64) -> Self {
        Self { name, number, repeated: false, kind, type_name: "", oneof: None }
    }

    pub const fn of(name: &'a str, number: u32, type_name: &'a str) -> Self {
        Self { type_name, ..Self::one(name, number, 11) }
    }

    pub const fn many(self) -> Self {
        Self { repeated: true, ..self }
    }

    pub const fn in_oneof(self, index: u64) -> Self {
        Self { oneof: Some(index), ..self }
    }

    fn describe(&self) -> Proto {
        let label = if self.repeated { 3 } else { 1 };
        let mut field = Proto::default()
            .bytes(1, self.name.as_bytes())
            .varint(3, self.number.into())
            .varint(4, label)
            .varint(5, self.kind);
        if !self.type_name.is_empty() {
            field = field.bytes(6, self.type_name.as_bytes());
        }
        match self.oneof {
            Some(index) => field.varint(9, index),
            None => field,
        }
    }
}

/// The descriptor of a message type.
pub fn describe(name: &str, fields: &[Field<'_>]) -> Proto {
    let named = Proto::default().bytes(1, name.as_bytes());
    let whole = fields.iter().fold(named, |of, field| of.message(2, &field.describe()));
    let oneofs = fields.iter().filter_map(|field| field.oneof).max().map_or(0, |most| most + 1);
    (0..oneofs).fold(whole, |of, index| {
        of.message(8, &Proto::default().bytes(1, format!("oneof_{index}").as_bytes()))
    })
}

/// A file of message types.
pub fn file(name: &str, package: &str, uses: &[&str], syntax: &str, types: &[Proto]) -> Proto {
    let head = Proto::default().bytes(1, name.as_bytes()).bytes(2, package.as_bytes());
    let head = uses.iter().fold(head, |of, name| of.bytes(3, name.as_bytes()));
    let whole = types.iter().fold(head, |of, inner| of.message(4, inner));
    if syntax == "proto2" { whole } else { whole.bytes(12, syntax.as_bytes()) }
}

/// A descriptor set.
pub fn set(files: &[Proto]) -> Vec<u8> {
    files.iter().fold(Proto::default(), |of, file| of.message(1, file)).0
}

/// The descriptor set of Foxglove's messages that are used here.
pub fn foxglove() -> Vec<u8> {
    let time = describe("Timestamp", &[Field::one("seconds", 1, 3), Field::one("nanos", 2, 5)]);
    let xyz = [Field::one("x", 1, 1), Field::one("y", 2, 1), Field::one("z", 3, 1)];
    let xyzw = [
        Field::one("x", 1, 1),
        Field::one("y", 2, 1),
        Field::one("z", 3, 1),
        Field::one("w", 4, 1),
    ];
    let stamp = || Field::of("timestamp", 1, ".google.protobuf.Timestamp");
    let joint = [
        Field::one("name", 1, 9),
        // `optional double`: each is a oneof of its own.
        Field::one("position", 2, 1).in_oneof(0),
        Field::one("velocity", 3, 1).in_oneof(1),
    ];
    let types = [
        describe("Vector3", &xyz),
        describe("Point3", &xyz),
        describe("Quaternion", &xyzw),
        describe(
            "Pose",
            &[
                Field::of("position", 1, ".foxglove.Vector3"),
                Field::of("orientation", 2, ".foxglove.Quaternion"),
            ],
        ),
        describe(
            "PoseInFrame",
            &[stamp(), Field::one("frame_id", 2, 9), Field::of("pose", 3, ".foxglove.Pose")],
        ),
        describe(
            "Point3InFrame",
            &[stamp(), Field::one("frame_id", 2, 9), Field::of("point", 3, ".foxglove.Point3")],
        ),
        describe("JointState", &joint),
        describe("JointStates", &[stamp(), Field::of("joints", 2, ".foxglove.JointState").many()]),
    ];
    let time_file = "google/protobuf/timestamp.proto";
    set(&[
        file(time_file, "google.protobuf", &[], "proto3", &[time]),
        file("foxglove/all.proto", "foxglove", &[time_file], "proto3", &types),
    ])
}

/// A `google.protobuf.Timestamp`.
pub fn timestamp(ns: i64) -> Proto {
    let part = |value: i64| u64::try_from(value).expect("after 1970");
    Proto::default().varint(1, part(ns / 1_000_000_000)).varint(2, part(ns % 1_000_000_000))
}
