//! `[[stations.lengths]]` and `[[tracker.lengths]]`: instruments that read one length of a target, in a table of stations or a log.

use serde::{Deserialize, Serialize};

use super::{LengthUnit, StampField, StandsOn};

/// An instrument that reads one length, its column and what is known of it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LengthColumns {
    pub name: String,
    pub reads: LengthRead,
    pub column: String,
    pub unit: LengthUnit,
    pub sd_mm: f64,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sd: Option<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub target: Option<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub on: Option<StandsOn>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub place: Option<KnownPlace>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub offset: Option<KnownOffset>,
}

/// An instrument that reads one length, its topic in the tracker's log and what is known of it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LoggedLength {
    pub name: String,
    pub reads: LengthRead,
    pub topic: String,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub field: Option<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stamp: Option<StampField>,
    pub unit: LengthUnit,
    pub sd_mm: f64,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub target: Option<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub on: Option<StandsOn>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub place: Option<KnownPlace>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub offset: Option<KnownOffset>,
}

/// An instrument of one length as a source of readings, wherever they come from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LengthSource<'s> {
    pub name: &'s str,
    pub reads: LengthRead,
    pub sd_mm: f64,
    /// Name of the target that it reads; `None`: the main one.
    pub target: Option<&'s str>,
    /// The base or the floor, on which its anchor or plane stands; `None` where it is not stated.
    pub on: Option<StandsOn>,
    /// The anchor's place in the base's frame; `None`: found.
    pub place: Option<KnownPlace>,
    /// The reading at no distance; `None`: found.
    pub offset: Option<KnownOffset>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum LengthRead {
    Distance,
    Height,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct KnownPlace {
    pub xyz_mm: [f64; 3],
    pub sd_mm: f64,
}

/// The reading of a distance at its anchor.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct KnownOffset {
    pub mm: f64,
    pub sd_mm: f64,
}

impl LengthRead {
    pub const fn word(self) -> &'static str {
        match self {
            Self::Distance => "distance",
            Self::Height => "height",
        }
    }
}

impl LengthColumns {
    pub fn source(&self) -> LengthSource<'_> {
        LengthSource {
            name: &self.name,
            reads: self.reads,
            sd_mm: self.sd_mm,
            target: self.target.as_deref(),
            on: self.on,
            place: self.place,
            offset: self.offset,
        }
    }
}

impl LoggedLength {
    pub fn source(&self) -> LengthSource<'_> {
        LengthSource {
            name: &self.name,
            reads: self.reads,
            sd_mm: self.sd_mm,
            target: self.target.as_deref(),
            on: self.on,
            place: self.place,
            offset: self.offset,
        }
    }
}

/// Whether a length can be a reading where there is a least one, mm: zeros at a least of zero are missing readings.
pub fn is_length(least_mm: Option<f64>, mm: f64) -> bool {
    let is_below = |least_mm: f64| mm < least_mm || (mm == 0.0 && least_mm == 0.0);
    !least_mm.is_some_and(is_below)
}

impl LengthSource<'_> {
    /// The least reading that there can be, mm: zero, or below it where such an offset is stated; `None` of heights.
    pub fn least_mm(&self) -> Option<f64> {
        let offset_mm = self.offset.map_or(0.0, |own| own.mm);
        (self.reads == LengthRead::Distance).then_some(offset_mm.min(0.0))
    }

    /// Place of its target among those with these names; `None` where there is no such target.
    pub fn target_among(&self, names: &[String]) -> Option<usize> {
        match self.target {
            None => Some(0),
            Some(named) => names.iter().position(|own| own == named),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> LengthColumns {
        toml::from_str(text).unwrap()
    }

    #[test]
    fn a_distance_is_above_zero_or_above_its_offset() {
        let bar =
            "name = \"bar\"\nreads = \"distance\"\ncolumn = \"L\"\nunit = \"mm\"\nsd_mm = 0.005\n";
        let face = bar.replace("distance", "height");
        let sphere = format!(
            "{bar}sd = \"u\"\non = \"base\"\nplace = {{ xyz_mm = [900, 0, 300], sd_mm = 5 }}\noffset = {{ mm = -12.7, sd_mm = 0.001 }}\n"
        );
        let least = [bar, &sphere, &face].map(|text| read(text).source().least_mm());
        assert_eq!(least, [Some(0.0), Some(-12.7), None]);
        for text in [bar, &sphere, &face] {
            // What is written is read back: a run's name follows from it.
            let own = read(text);
            assert_eq!(read(&toml::to_string(&own).unwrap()), own);
        }
    }
}
