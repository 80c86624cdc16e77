//! Rows of a table: one struct of typed fields ↔ whole columns.
//!
//! [`row!`](crate::table::row) declares the struct of a table. A field is the column of its name; a field that is a
//! point, a quaternion or a covariance names its columns. Robot, session and run are outside the rows where all have the
//! same. The struct writes ([`Row::table`], which sorts the rows in the table's order) and reads ([`Row::read`]); a test
//! compares it with its schema.
//!
//! An enumeration is a word only in the file: [`words!`](crate::table::words) pairs its values with their words once.

use std::sync::Arc;

use arrow::array::{Array, AsArray};
use arrow::datatypes::{Float64Type, Int64Type, TimestampMicrosecondType};

use super::{Columns, Table, TableError, Value};
use crate::manifest::RunKey;
use crate::schema::{self, ColumnType, TableSchema};
use crate::units::WallTime;

/// The rows of one table.
pub trait Row: Sized {
    /// The table's name.
    const TABLE: &'static str;

    /// Every field of all rows as columns.
    fn put(rows: &[Self], columns: Columns) -> Columns;

    /// The rows of a table, in its order.
    fn read(table: &Table) -> Vec<Self>;

    /// The fields as columns, in their order.
    #[cfg(test)]
    fn columns() -> Vec<FieldColumn>;

    /// The table's contract.
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
    /// The table that they make.
    pub table: Table,
}

impl<R: Row> Rows<R> {
    fn new(rows: Vec<R>, key: impl FnOnce(Columns) -> Columns) -> Result<Self, TableError> {
        let columns = R::put(&rows, key(Columns::new(R::schema(), rows.len())));
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

#[cfg(test)]
pub struct FieldColumn {
    pub name: &'static str,
    /// Type of its values.
    pub kind: ColumnType,
    /// Whether a value may be absent.
    pub nullable: bool,
    /// Whether an enumeration has this word; `None` where it is no enumeration.
    pub knows: fn(&str) -> Option<bool>,
}

/// A value that one column can hold.
pub trait Stored: Sized + 'static {
    /// Type of the value in a column.
    type As<'v>: Value;

    /// The value for a column.
    fn stored(&self) -> Self::As<'_>;

    /// The value in a row where it is not null.
    fn at(array: &dyn Array, row: usize) -> Self;

    /// Whether an enumeration has this word; `None` where it is no enumeration.
    fn knows(_word: &str) -> Option<bool> {
        None
    }
}

/// The type of a field of a row: a value, several that belong together, or either as an option.
pub trait Field: Sized + 'static {
    /// Type of the values of its columns.
    const KIND: ColumnType;
    /// Whether it may be absent.
    const NULLABLE: bool;

    /// Puts the field of all rows into the columns of these names.
    fn put<'v>(
        columns: Columns,
        names: &'static [&'static str],
        values: impl Iterator<Item = &'v Self> + Clone,
    ) -> Columns;

    /// The field of every row, read from the columns of these names.
    fn all<'t>(table: &'t Table, names: &'static [&'static str])
    -> impl Iterator<Item = Self> + 't;

    /// Like [`Stored::knows`].
    fn knows(_word: &str) -> Option<bool> {
        None
    }
}

impl<T: Stored> Field for T {
    const KIND: ColumnType = <T::As<'static> as Value>::KIND;
    const NULLABLE: bool = false;

    fn put<'v>(
        columns: Columns,
        names: &'static [&'static str],
        values: impl Iterator<Item = &'v Self> + Clone,
    ) -> Columns {
        columns.column(names[0], values.map(Stored::stored))
    }

    fn all<'t>(
        table: &'t Table,
        names: &'static [&'static str],
    ) -> impl Iterator<Item = Self> + 't {
        let array = table.array(names[0]);
        (0..table.rows()).map(move |row| T::at(array, row))
    }

    fn knows(word: &str) -> Option<bool> {
        T::knows(word)
    }
}

impl<T: Stored> Field for Option<T> {
    const KIND: ColumnType = <T as Field>::KIND;
    const NULLABLE: bool = true;

    fn put<'v>(
        columns: Columns,
        names: &'static [&'static str],
        values: impl Iterator<Item = &'v Self> + Clone,
    ) -> Columns {
        let stored = |value: &'v Self| value.as_ref().map(Stored::stored);
        columns.column(names[0], values.map(stored))
    }

    fn all<'t>(
        table: &'t Table,
        names: &'static [&'static str],
    ) -> impl Iterator<Item = Self> + 't {
        let array = table.array(names[0]);
        let value = move |row| array.is_valid(row).then(|| T::at(array, row));
        (0..table.rows()).map(value)
    }

    fn knows(word: &str) -> Option<bool> {
        T::knows(word)
    }
}

impl<const N: usize> Field for [f64; N] {
    const KIND: ColumnType = ColumnType::Float64;
    const NULLABLE: bool = false;

    fn put<'v>(
        columns: Columns,
        names: &'static [&'static str],
        values: impl Iterator<Item = &'v Self> + Clone,
    ) -> Columns {
        columns.group(of_number(names), values.copied())
    }

    fn all<'t>(
        table: &'t Table,
        names: &'static [&'static str],
    ) -> impl Iterator<Item = Self> + 't {
        let parts = of_number(names).map(|name| table.f64(name));
        (0..table.rows()).map(move |row| parts.map(|part| part.value(row)))
    }
}

impl<const N: usize> Field for Option<[f64; N]> {
    const KIND: ColumnType = ColumnType::Float64;
    const NULLABLE: bool = true;

    fn put<'v>(
        columns: Columns,
        names: &'static [&'static str],
        values: impl Iterator<Item = &'v Self> + Clone,
    ) -> Columns {
        columns.group(of_number(names), values.copied())
    }

    /// A row that lacks one of the values has none.
    fn all<'t>(
        table: &'t Table,
        names: &'static [&'static str],
    ) -> impl Iterator<Item = Self> + 't {
        let parts = of_number(names).map(|name| table.f64(name));
        (0..table.rows()).map(move |row| {
            let whole = parts.iter().all(|part| part.is_valid(row));
            whole.then(|| parts.map(|part| part.value(row)))
        })
    }
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

/// An enumeration that is a word in tables.
pub trait Word: Copy + 'static {
    /// The word of a value.
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

/// The words of enumerations: `words! { Split { None: "none", Blocks: "blocks" } }`.
macro_rules! words {
    ($($enumeration:ty { $($value:ident $(($of:path))? : $word:literal),+ $(,)? })+) => {$(
        impl $crate::table::Word for $enumeration {
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
    )+};
}
pub(crate) use words;

/// The struct of a table's rows: `row! { pub struct ClockRow of "clocks" { offset_ns: f64, … } }`. A field is the column of its
/// name, or the columns that it names: `at as [x_mm, y_mm, z_mm]: [f64; 3]`.
macro_rules! row {
    (
        $(#[$meta:meta])*
        pub struct $row:ident of $table:literal {
            $($(#[$doc:meta])* $field:ident $(as [$($column:ident),+ $(,)?])? : $kind:ty,)+
        }
    ) => {
        $(#[$meta])*
        #[derive(Debug, Clone, PartialEq)]
        pub struct $row {
            $($(#[$doc])* pub $field: $kind,)+
        }

        impl $crate::table::Row for $row {
            const TABLE: &'static str = $table;

            fn put(rows: &[Self], columns: $crate::table::Columns) -> $crate::table::Columns {
                $(let columns = <$kind as $crate::table::Field>::put(
                    columns,
                    $crate::table::names!($field $(, $($column)+)?),
                    rows.iter().map(|row| &row.$field),
                );)+
                columns
            }

            fn read(table: &$crate::table::Table) -> Vec<Self> {
                $(let mut $field = <$kind as $crate::table::Field>::all(
                    table,
                    $crate::table::names!($field $(, $($column)+)?),
                );)+
                let every = "every column has a value for each row, as a table is checked";
                (0..table.rows())
                    .map(|_| Self { $($field: $field.next().expect(every),)+ })
                    .collect()
            }

            #[cfg(test)]
            fn columns() -> Vec<$crate::table::FieldColumn> {
                let mut columns = Vec::new();
                $(for &name in $crate::table::names!($field $(, $($column)+)?) {
                    columns.push($crate::table::FieldColumn {
                        name,
                        kind: <$kind as $crate::table::Field>::KIND,
                        nullable: <$kind as $crate::table::Field>::NULLABLE,
                        knows: <$kind as $crate::table::Field>::knows,
                    });
                })+
                columns
            }
        }
    };
}
pub(crate) use row;

/// The names of a field's columns.
macro_rules! names {
    ($field:ident) => {
        &[stringify!($field)]
    };
    ($field:ident, $($column:ident)+) => {
        &[$(stringify!($column)),+]
    };
}
pub(crate) use names;
