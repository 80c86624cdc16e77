//! Rows of a table: one struct of typed fields ↔ whole columns.
//!
//! `row!` declares the struct of a table, `columns!` that of columns which several tables have alike: it is a field of their
//! rows. A field is the column of its name; one of several numbers names its columns. Robot, session and run are outside the rows where all have the same.
//! `words!` pairs the values of an enumeration with its words.

use std::sync::Arc;

use arrow_array::Array;
use arrow_array::cast::AsArray;
use arrow_array::types::{Float64Type, Int64Type, TimestampMicrosecondType};
use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};

use crate::manifest::RunKey;
use crate::schema::{self, ColumnType, TableSchema};
use crate::table::{Columns, Table, TableError, Value};
use crate::units::WallTime;

pub trait Row: Field {
    const TABLE: &'static str;

    fn read(table: &Table) -> Vec<Self> {
        Self::all(table, &[]).collect()
    }

    fn schema() -> &'static TableSchema {
        schema::find(Self::TABLE).expect("a test finds the schema of every row")
    }

    /// The table of rows that all have one robot, session and run.
    fn table(rows: Vec<Self>, key: &RunKey) -> Result<Rows<Self>, TableError> {
        Rows::new(rows, |columns| columns.key(key))
    }

    /// The table of rows that have their own robot, session and run.
    fn table_of_several(rows: Vec<Self>) -> Result<Rows<Self>, TableError> {
        Rows::new(rows, |columns| columns)
    }
}

/// Rows in the order of their table, and the table.
#[derive(Debug, Clone, PartialEq)]
pub struct Rows<R> {
    pub rows: Vec<R>,
    pub table: Table,
}

impl<R: Row> Rows<R> {
    fn new(rows: Vec<R>, key: impl FnOnce(Columns) -> Columns) -> Result<Self, TableError> {
        let columns = R::put(key(Columns::new(R::schema(), rows.len())), &[], rows.iter());
        let (table, order) = columns.finish_in_order()?;
        let rows = match order {
            None => rows,
            Some(order) => {
                let mut given: Vec<Option<R>> = rows.into_iter().map(Some).collect();
                order.iter().filter_map(|&row| given[row].take()).collect()
            }
        };
        Ok(Self { rows, table })
    }
}

pub struct FieldColumn {
    pub name: &'static str,
    pub kind: ColumnType,
    pub nullable: bool,
    /// Whether an enumeration has this word; `None` where it is no enumeration.
    pub knows: fn(&str) -> Option<bool>,
}

/// A value that one column can hold.
pub trait Stored: Sized + 'static {
    type As<'v>: Value;

    fn stored(&self) -> Self::As<'_>;

    /// The value in a row where it is not null.
    fn at(array: &dyn Array, row: usize) -> Self;

    /// Whether an enumeration has this word; `None` where it is no enumeration.
    fn knows(_word: &str) -> Option<bool> {
        None
    }
}

pub type Names = &'static [&'static str];

/// The field of each row, which can be gone through again.
pub trait Each<'v, T: 'v>: Iterator<Item = &'v T> + Clone {}

impl<'v, T: 'v, I: Iterator<Item = &'v T> + Clone> Each<'v, T> for I {}

/// The type of a field of a row: a value, several that belong together, or either as an option.
pub trait Field: Sized + 'static {
    /// Puts the field of all rows into the columns of these names; those of a struct have their own.
    fn put<'v>(columns: Columns, names: Names, values: impl Each<'v, Self>) -> Columns;

    /// The field of every row, read from the columns of these names.
    fn all(table: &Table, names: Names) -> impl Iterator<Item = Self>;

    fn columns(names: Names) -> Vec<FieldColumn>;
}

impl<T: Stored> Field for T {
    fn put<'v>(columns: Columns, names: Names, values: impl Each<'v, Self>) -> Columns {
        columns.column(names[0], values.map(Stored::stored))
    }

    fn all(table: &Table, names: Names) -> impl Iterator<Item = Self> {
        let array = table.array(names[0]);
        (0..table.rows()).map(move |row| T::at(array, row))
    }

    fn columns(names: Names) -> Vec<FieldColumn> {
        let kind = <T::As<'static> as Value>::KIND;
        vec![FieldColumn { name: names[0], kind, nullable: false, knows: T::knows }]
    }
}

impl<T: Stored> Field for Option<T> {
    fn put<'v>(columns: Columns, names: Names, values: impl Each<'v, Self>) -> Columns {
        columns.column(names[0], values.map(|value| value.as_ref().map(Stored::stored)))
    }

    fn all(table: &Table, names: Names) -> impl Iterator<Item = Self> {
        let array = table.array(names[0]);
        (0..table.rows()).map(move |row| array.is_valid(row).then(|| T::at(array, row)))
    }

    fn columns(names: Names) -> Vec<FieldColumn> {
        nullable(T::columns(names))
    }
}

impl<const N: usize> Field for [f64; N] {
    fn put<'v>(columns: Columns, names: Names, values: impl Each<'v, Self>) -> Columns {
        columns.group(of_number(names), values.copied())
    }

    fn all(table: &Table, names: Names) -> impl Iterator<Item = Self> {
        let parts = of_number(names).map(|name| table.f64(name));
        (0..table.rows()).map(move |row| parts.map(|part| part.value(row)))
    }

    fn columns(names: Names) -> Vec<FieldColumn> {
        names.chunks(1).flat_map(f64::columns).collect()
    }
}

impl<const N: usize> Field for Option<[f64; N]> {
    fn put<'v>(columns: Columns, names: Names, values: impl Each<'v, Self>) -> Columns {
        columns.group(of_number(names), values.copied())
    }

    /// A row that lacks one of the values has none.
    fn all(table: &Table, names: Names) -> impl Iterator<Item = Self> {
        let parts = of_number(names).map(|name| table.f64(name));
        (0..table.rows()).map(move |row| {
            let whole = parts.iter().all(|part| part.is_valid(row));
            whole.then(|| parts.map(|part| part.value(row)))
        })
    }

    fn columns(names: Names) -> Vec<FieldColumn> {
        nullable(<[f64; N]>::columns(names))
    }
}

/// x y z, mm, and the quaternion x y z w, as it was written: normalised anew it would differ in its last bits.
impl Field for Isometry3<f64> {
    fn put<'v>(columns: Columns, names: Names, values: impl Each<'v, Self>) -> Columns {
        let numbers = |own: &Self| -> [f64; 7] {
            let ([x, y, z], [qx, qy, qz, qw]) =
                (own.translation.vector.into(), own.rotation.coords.into());
            [x, y, z, qx, qy, qz, qw]
        };
        columns.group(of_number(names), values.map(numbers))
    }

    fn all(table: &Table, names: Names) -> impl Iterator<Item = Self> {
        <[f64; 7]>::all(table, names).map(|[x, y, z, qx, qy, qz, qw]| {
            let turn = UnitQuaternion::new_unchecked(Quaternion::new(qw, qx, qy, qz));
            Self::from_parts(Translation3::new(x, y, z), turn)
        })
    }

    fn columns(names: Names) -> Vec<FieldColumn> {
        <[f64; 7]>::columns(names)
    }
}

fn nullable(columns: Vec<FieldColumn>) -> Vec<FieldColumn> {
    columns.into_iter().map(|own| FieldColumn { nullable: true, ..own }).collect()
}

fn of_number<const N: usize>(names: &[&'static str]) -> [&'static str; N] {
    let names: Result<[&'static str; N], _> = names.try_into();
    names.expect("a field of several numbers names a column for each")
}

macro_rules! stored {
    ($v:lifetime; $($own:ty as $with:ty: $stored:expr, $at:expr;)+) => {$(
        impl Stored for $own {
            type As<$v> = $with;
            fn stored(&self) -> Self::As<'_> {
                $stored(self)
            }
            fn at(array: &dyn Array, row: usize) -> Self {
                $at(array, row)
            }
        }
    )+};
}
stored! {
    'v;
    f64 as f64: |own: &f64| *own, |array: &dyn Array, row| array.as_primitive::<Float64Type>().value(row);
    i64 as i64: |own: &i64| *own, whole;
    u32 as u32: |own: &u32| *own, |array, row| u32::try_from(whole(array, row)).unwrap_or(u32::MAX);
    u64 as u64: |own: &u64| *own, |array, row| whole(array, row).cast_unsigned();
    usize as usize: |own: &usize| *own, |array, row| usize::try_from(whole(array, row)).unwrap_or(usize::MAX);
    WallTime as WallTime: |own: &WallTime| *own, |array: &dyn Array, row| WallTime::of_us(array.as_primitive::<TimestampMicrosecondType>().value(row));
    bool as bool: |own: &bool| *own, |array: &dyn Array, row| array.as_boolean().value(row);
    String as &'v str: String::as_str, |array, row| text(array, row).to_owned();
    Arc<str> as &'v str: AsRef::as_ref, |array, row| Self::from(text(array, row));
    Vec<f64> as &'v [f64]: Vec::as_slice, numbers;
    Arc<[f64]> as &'v [f64]: AsRef::as_ref, |array, row| Self::from(numbers(array, row));
    Vec<u64> as &'v [u64]: Vec::as_slice, whole_numbers;
    Vec<String> as &'v [String]: Vec::as_slice, texts;
    Arc<[String]> as &'v [String]: AsRef::as_ref, |array, row| Self::from(texts(array, row));
}

/// A whole number; those of a field of unsigned numbers are never negative in a table of posegrid.
fn whole(array: &dyn Array, row: usize) -> i64 {
    array.as_primitive::<Int64Type>().value(row)
}

fn text(array: &dyn Array, row: usize) -> &str {
    array.as_string::<i32>().value(row)
}

fn numbers(array: &dyn Array, row: usize) -> Vec<f64> {
    let list = array.as_list::<i32>().value(row);
    list.as_primitive::<Float64Type>().values().to_vec()
}

fn whole_numbers(array: &dyn Array, row: usize) -> Vec<u64> {
    let list = array.as_list::<i32>().value(row);
    let values = list.as_primitive::<Int64Type>().values().iter();
    values.map(|value| value.cast_unsigned()).collect()
}

fn texts(array: &dyn Array, row: usize) -> Vec<String> {
    let list = array.as_list::<i32>().value(row);
    let texts = list.as_string::<i32>().iter().flatten();
    texts.map(str::to_owned).collect()
}

pub trait Word: Copy + 'static {
    fn word(self) -> &'static str;

    /// The value of a word; `None` where it is no word of this enumeration.
    fn of_word(word: &str) -> Option<Self>;
}

impl<W: Word> Stored for W {
    type As<'v> = &'static str;

    fn stored(&self) -> &'static str {
        self.word()
    }

    fn at(array: &dyn Array, row: usize) -> Self {
        let value = W::of_word(text(array, row));
        value.expect("a test holds the words that the schema allows against the enumeration")
    }

    fn knows(word: &str) -> Option<bool> {
        Some(W::of_word(word).is_some())
    }
}

/// The words of enumerations: `words! { Split { None: "none", Blocks: "blocks" } }`. One that only tables have is declared with its
/// words: `words! { pub enum Entry { Bin: "bin", Fitted: "fitted" } }`.
macro_rules! words {
    () => {};
    (
        $(#[$meta:meta])*
        pub enum $enumeration:ident { $($(#[$doc:meta])* $value:ident: $word:literal,)+ }
        $($more:tt)*
    ) => {
        $(#[$meta])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        pub enum $enumeration {
            $($(#[$doc])* $value,)+
        }
        $crate::rows::words! { $enumeration { $($value: $word),+ } $($more)* }
    };
    ($enumeration:ty { $($value:ident $(($of:path))? : $word:literal),+ $(,)? } $($more:tt)*) => {
        impl $crate::rows::Word for $enumeration {
            fn word(self) -> &'static str {
                match self {
                    $(Self::$value $(($of))? => $word,)+
                }
            }

            fn of_word(word: &str) -> Option<Self> {
                match word {
                    $($word => Some(Self::$value $(($of))?),)+
                    _ => None,
                }
            }
        }
        $crate::rows::words! { $($more)* }
    };
}
pub(crate) use words;

/// The struct of a table's rows: `row! { pub struct ClockRow of "clocks" { offset_ns: f64, … } }`; its fields are those of
/// `columns!`.
macro_rules! row {
    ($(#[$meta:meta])* pub struct $row:ident of $table:literal { $($fields:tt)+ }) => {
        $crate::rows::columns! { $(#[$meta])* pub struct $row { $($fields)+ } }

        impl $crate::rows::Row for $row {
            const TABLE: &'static str = $table;
        }
    };
}
pub(crate) use row;

/// A struct of columns. A field is the column of its name, or the columns that it names, as a list or by what it is
/// (`names!`): `at as [x_mm, y_mm, z_mm]`, `error as point`, `shift_mm as [shift: point]`. A struct that stands
/// elsewhere gets its columns by `columns! { of Conditions { … } }`.
macro_rules! columns {
    (
        $(#[$meta:meta])*
        pub struct $group:ident {
            $($(#[$doc:meta])* $field:ident $(as $names:tt)? : $kind:ty,)+
        }
    ) => {
        $(#[$meta])*
        #[derive(Debug, Clone, PartialEq)]
        pub struct $group {
            $($(#[$doc])* pub $field: $kind,)+
        }
        $crate::rows::columns! { of $group { $($field $(as $names)? : $kind,)+ } }
    };
    (of $group:ident { $($field:ident $(as $names:tt)? : $kind:ty,)+ }) => {
        impl $crate::rows::Field for $group {
            fn put<'v>(
                columns: $crate::table::Columns,
                _: &'static [&'static str],
                values: impl $crate::rows::Each<'v, Self>,
            ) -> $crate::table::Columns {
                $(let columns = <$kind as $crate::rows::Field>::put(
                    columns,
                    $crate::rows::names!($field $(, $names)?),
                    values.clone().map(|own| &own.$field),
                );)+
                columns
            }

            fn all(
                table: &$crate::table::Table,
                _: &'static [&'static str],
            ) -> impl Iterator<Item = Self> {
                $(let mut $field = <$kind as $crate::rows::Field>::all(
                    table,
                    $crate::rows::names!($field $(, $names)?),
                );)+
                (0..table.rows()).map_while(move |_| Some(Self { $($field: $field.next()?,)+ }))
            }

            fn columns(_: &'static [&'static str]) -> Vec<$crate::rows::FieldColumn> {
                let mut columns = Vec::new();
                $(columns.extend(<$kind as $crate::rows::Field>::columns(
                    $crate::rows::names!($field $(, $names)?),
                ));)+
                columns
            }
        }
    };
}
pub(crate) use columns;

/// The names of a field's columns: its own, a list, or its own (or another prefix) with what follows for a point, a turn (quaternion),
/// a placement or a covariance.
macro_rules! names {
    ($field:ident) => {
        &[stringify!($field)]
    };
    ($field:ident, [$($column:ident),+ $(,)?]) => {
        &[$(stringify!($column)),+]
    };
    ($field:ident, [$prefix:ident: $kind:ident]) => {
        $crate::rows::names!($prefix, $kind)
    };
    ($field:ident, point) => {
        $crate::rows::names!($field + "_x_mm" "_y_mm" "_z_mm")
    };
    ($field:ident, turn) => {
        $crate::rows::names!($field + "_qx" "_qy" "_qz" "_qw")
    };
    ($field:ident, placement) => {
        $crate::rows::names!($field + "_x_mm" "_y_mm" "_z_mm" "_qx" "_qy" "_qz" "_qw")
    };
    ($field:ident, covariance) => {
        $crate::rows::names!(
            $field + "_xx_mm2" "_xy_mm2" "_xz_mm2" "_yy_mm2" "_yz_mm2" "_zz_mm2"
        )
    };
    ($field:ident + $($end:literal)+) => {
        &[$(concat!(stringify!($field), $end)),+]
    };
}
pub(crate) use names;
