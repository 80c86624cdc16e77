//! Arms of many kinds: robot files of this repository, and chains in standard DH typed here.

use std::f64::consts::FRAC_PI_2;

use posegrid::kinematics::{
    Arm, Axis, Chain, Convention, Element, Joint, LinkQuantity, Motion, Parameter, RobotFile,
};

/// An arm and the way in which its random joint values are drawn.
pub struct Drawn {
    pub name: &'static str,
    pub arm: Arm,
    /// Which joint is a length, where one is.
    pub length: Option<usize>,
}

/// A link in standard DH: a, α°, d, offset°, and the limits of its joint in degrees.
type Link = ([f64; 4], [f64; 2]);

impl Drawn {
    pub fn new(name: &'static str, arm: Arm) -> Self {
        Self { name, arm, length: None }
    }

    /// The unit of a joint: 1 rad, or the lever.
    pub fn unit(&self, joint: usize, lever_mm: f64) -> f64 {
        if self.length == Some(joint) { lever_mm } else { 1.0 }
    }

    /// Random joint values, uniform within the limits.
    pub fn joints(&self, number: u32) -> Vec<f64> {
        let share = |place: usize| uniform(number, place);
        let joints = self.arm.joints().iter().enumerate();
        let value = |(place, joint): (usize, &Joint)| {
            joint.lower + (joint.upper - joint.lower) * share(place)
        };
        joints.map(value).collect()
    }

    /// Joint values beside others: up to 0.05 rad or 25 mm away, each.
    pub fn beside(&self, joints: &[f64], number: u32) -> Vec<f64> {
        let moved = |(place, q): (usize, &f64)| {
            q + 0.1 * (uniform(number, place + 100) - 0.5) * self.unit(place, 500.0)
        };
        joints.iter().enumerate().map(moved).collect()
    }
}

/// A number from 0 to 1, the upper bits of a mixed counter (Steele, Lea and Flood 2014).
fn uniform(number: u32, place: usize) -> f64 {
    let counter = (u64::from(number) << 20) + place as u64 + 1;
    let mut bits = counter.wrapping_mul(0x9E37_79B9_7F4A_7C15);
    bits = (bits ^ (bits >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    bits = (bits ^ (bits >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    bits ^= bits >> 31;
    (bits >> 11) as f64 / 2.0_f64.powi(53)
}

fn of_file(text: &str) -> Arm {
    let file: RobotFile = toml::from_str(text).expect("a robot file of this repository");
    file.arm().expect("a valid arm")
}

fn elements(links: &[Link], first: usize) -> Vec<Element> {
    let free = |motion, nominal, joint, quantity| Element::Free {
        motion,
        nominal,
        parameter: Parameter::Link { joint, quantity },
    };
    let along = Motion::Translation;
    let about = Motion::Rotation;
    let mut elements = Vec::new();
    for (place, ([a, alpha, d, offset], _)) in links.iter().enumerate() {
        let joint = first + place;
        let turn = Element::Joint { motion: about(Axis::Z), joint, sign: 1.0 };
        let number = joint + 1;
        elements.extend([
            turn,
            free(about(Axis::Z), offset.to_radians(), number, LinkQuantity::Theta),
            free(along(Axis::Z), *d, number, LinkQuantity::D),
            free(along(Axis::X), *a, number, LinkQuantity::A),
            free(about(Axis::X), alpha.to_radians(), number, LinkQuantity::Alpha),
        ]);
    }
    elements
}

fn joints(links: &[Link]) -> Vec<Joint> {
    let joint = |(place, (_, [lower, upper])): (usize, &Link)| Joint {
        name: format!("j{}", place + 1),
        lower: lower.to_radians(),
        upper: upper.to_radians(),
        slides: false,
    };
    links.iter().enumerate().map(joint).collect()
}

fn identity(size: usize) -> Vec<Vec<f64>> {
    let row = |row| (0..size).map(|column| f64::from(u8::from(row == column))).collect();
    (0..size).map(row).collect()
}

pub fn of_links(name: &str, links: &[Link]) -> Arm {
    let chain = Chain::new(elements(links, 0));
    Arm::new(name.to_owned(), Convention::StandardDh, joints(links), &identity(links.len()), chain)
        .expect("an arm")
}

pub fn kr210() -> Arm {
    of_file(include_str!("../../../pipelines/robots/kr210-r2700-extra.toml"))
}

pub fn ur10() -> Arm {
    of_file(include_str!("../../../pipelines/robots/ur10.toml"))
}

/// Seven axes like those of an LBR iiwa 14: shoulder, elbow and wrist in three points.
pub fn iiwa() -> Arm {
    of_links(
        "iiwa",
        &[
            ([0.0, -90.0, 360.0, 0.0], [-170.0, 170.0]),
            ([0.0, 90.0, 0.0, 0.0], [-120.0, 120.0]),
            ([0.0, 90.0, 420.0, 0.0], [-170.0, 170.0]),
            ([0.0, -90.0, 0.0, 0.0], [-120.0, 120.0]),
            ([0.0, -90.0, 400.0, 0.0], [-170.0, 170.0]),
            ([0.0, 90.0, 0.0, 0.0], [-120.0, 120.0]),
            ([0.0, 0.0, 126.0, 0.0], [-175.0, 175.0]),
        ],
    )
}

/// Seven axes like those of a Barrett WAM: the elbow is offset.
pub fn wam() -> Arm {
    of_links(
        "wam",
        &[
            ([0.0, -90.0, 0.0, 0.0], [-150.0, 150.0]),
            ([0.0, 90.0, 0.0, 0.0], [-113.0, 113.0]),
            ([45.0, -90.0, 550.0, 0.0], [-157.0, 157.0]),
            ([-45.0, 90.0, 0.0, 0.0], [-50.0, 180.0]),
            ([0.0, -90.0, 300.0, 0.0], [-273.0, 71.0]),
            ([0.0, 90.0, 0.0, 0.0], [-90.0, 90.0]),
            ([0.0, 0.0, 60.0, 0.0], [-172.0, 172.0]),
        ],
    )
}

/// The links of a six-axis arm with a spherical wrist; joint 3 and joint 6 turn by more than a turn.
const FANUC: [Link; 6] = [
    ([150.0, 90.0, 525.0, 0.0], [-170.0, 170.0]),
    ([790.0, 0.0, 0.0, 90.0], [-100.0, 160.0]),
    ([250.0, 90.0, 0.0, 0.0], [-185.0, 273.0]),
    ([0.0, -90.0, 835.0, 0.0], [-200.0, 200.0]),
    ([0.0, 90.0, 0.0, 0.0], [-140.0, 140.0]),
    ([0.0, 0.0, 100.0, 0.0], [-450.0, 450.0]),
];

/// Axis 3 turns by what joints 2 and 3 report together.
pub fn coupled() -> Arm {
    let mut map = identity(6);
    map[2][1] = 1.0;
    let chain = Chain::new(elements(&FANUC, 0));
    Arm::new("coupled".to_owned(), Convention::StandardDh, joints(&FANUC), &map, chain)
        .expect("an arm")
}

/// A six-axis arm whose wrist does not meet in a point: axis 5 is 150 mm beside axis 4.
pub fn offset_wrist() -> Arm {
    of_links(
        "offset wrist",
        &[
            ([0.0, 90.0, 245.0, 0.0], [-180.0, 180.0]),
            ([540.0, 0.0, 0.0, 90.0], [-180.0, 180.0]),
            ([0.0, 90.0, 0.0, 0.0], [-270.0, 270.0]),
            ([0.0, -90.0, 540.0, 0.0], [-190.0, 190.0]),
            ([0.0, 90.0, 150.0, 0.0], [-180.0, 180.0]),
            ([0.0, 0.0, 160.0, 0.0], [-225.0, 225.0]),
        ],
    )
}

/// The links of the coupled arm on a linear track of 3 m along the base's y axis.
pub fn on_track() -> Arm {
    let mut own =
        vec![Element::Joint { motion: Motion::Translation(Axis::Y), joint: 0, sign: 1.0 }];
    own.extend(elements(&FANUC, 1));
    let mut all =
        vec![Joint { name: "track".to_owned(), lower: -1500.0, upper: 1500.0, slides: true }];
    all.extend(joints(&FANUC));
    for (place, joint) in all.iter_mut().enumerate().skip(1) {
        joint.name = format!("j{}", place + 1);
    }
    Arm::new("track".to_owned(), Convention::StandardDh, all, &identity(7), Chain::new(own))
        .expect("an arm")
}

/// Five axes: base, three parallel ones, and the roll of the tool.
pub fn five() -> Arm {
    of_links(
        "five axes",
        &[
            ([0.0, 90.0, 201.0, 0.0], [-170.0, 170.0]),
            ([190.0, 0.0, 0.0, 0.0], [-10.0, 130.0]),
            ([139.0, 0.0, 0.0, 0.0], [-130.0, 130.0]),
            ([0.0, 90.0, 0.0, 90.0], [-120.0, 120.0]),
            ([0.0, 0.0, 188.0, 0.0], [-170.0, 170.0]),
        ],
    )
}

/// Four axes of which the third is a lift: position and one angle.
pub fn scara() -> Arm {
    let links =
        [([350.0, 0.0, 400.0, 0.0], [-130.0, 130.0]), ([300.0, 0.0, 0.0, 0.0], [-145.0, 145.0])];
    let mut own = elements(&links, 0);
    own.push(Element::Joint { motion: Motion::Translation(Axis::Z), joint: 2, sign: -1.0 });
    own.extend(elements(&[([0.0, 180.0, 0.0, 0.0], [-360.0, 360.0])], 3));
    let mut all = joints(&links);
    all.push(Joint { name: "lift".to_owned(), lower: 0.0, upper: 200.0, slides: true });
    all.push(Joint {
        name: "roll".to_owned(),
        lower: -4.0 * FRAC_PI_2,
        upper: 4.0 * FRAC_PI_2,
        slides: false,
    });
    Arm::new("scara".to_owned(), Convention::StandardDh, all, &identity(4), Chain::new(own))
        .expect("an arm")
}

/// Four joints of a palletiser: parallelograms turn the wrist back by what joints 2 and 3 turn, so the tool stays upright.
pub fn palletiser() -> Arm {
    let links = [
        ([260.0, 90.0, 800.0, 0.0], [-180.0, 180.0]),
        ([1000.0, 0.0, 0.0, 90.0], [-40.0, 90.0]),
        ([1200.0, 0.0, 0.0, -90.0], [-100.0, 10.0]),
    ];
    let mut own = elements(&links, 0);
    for passive in [1, 2] {
        own.push(Element::Joint { motion: Motion::Rotation(Axis::Z), joint: passive, sign: -1.0 });
    }
    own.extend(elements(&[([0.0, 0.0, 0.0, 0.0], [0.0, 0.0])], 9)[1..].iter().cloned());
    own.push(Element::Free {
        motion: Motion::Rotation(Axis::X),
        nominal: FRAC_PI_2,
        parameter: Parameter::Link { joint: 11, quantity: LinkQuantity::Alpha },
    });
    own.extend(elements(&[([0.0, 0.0, -200.0, 0.0], [0.0, 0.0])], 3));
    let mut all = joints(&links);
    all.push(Joint { name: "j4".to_owned(), lower: -6.0, upper: 6.0, slides: false });
    Arm::new("palletiser".to_owned(), Convention::StandardDh, all, &identity(4), Chain::new(own))
        .expect("an arm")
}

/// Every arm that random poses are taken of.
pub fn arms() -> Vec<Drawn> {
    let irb120 = of_file(include_str!("../../../pipelines/robots/irb120.toml"));
    let mut track = Drawn::new("six axes on a track", on_track());
    track.length = Some(0);
    let mut scara = Drawn::new("scara, four axes", scara());
    scara.length = Some(2);
    vec![
        Drawn::new("KR 210 R2700 extra", kr210()),
        Drawn::new("IRB 120", irb120),
        Drawn::new("UR10", ur10()),
        Drawn::new("iiwa-like, seven", iiwa()),
        Drawn::new("WAM-like, seven", wam()),
        track,
        Drawn::new("coupled axes 2 and 3", coupled()),
        Drawn::new("offset wrist", offset_wrist()),
        Drawn::new("five axes", five()),
        scara,
        Drawn::new("palletiser, mimic", palletiser()),
    ]
}
