//! Small Parquet files with columns inside columns, made here.

use ::parquet::arrow::ArrowWriter;
use arrow_array::types::{Float64Type, Int32Type};
use arrow_array::{
    BinaryArray, BooleanArray, Decimal128Array, FixedSizeListArray, Float32Array, Int32Array,
    StructArray, TimestampMillisecondArray, UInt64Array,
};
use arrow_schema::Field;

use super::super::Cell;
use super::*;
use Cell::{Blank, Number, Text};

const BOUND: Bound = Bound { bytes: 1 << 20, advice: "split it" };

fn written(columns: Vec<(&str, ArrayRef)>) -> Vec<u8> {
    let batch = RecordBatch::try_from_iter_with_nullable(
        columns.into_iter().map(|(name, column)| (name, column, true)),
    )
    .unwrap();
    let mut bytes = Vec::new();
    let mut writer = ArrowWriter::try_new(&mut bytes, batch.schema(), None).unwrap();
    writer.write(&batch).unwrap();
    writer.close().unwrap();
    bytes
}

fn table(columns: Vec<(&str, ArrayRef)>) -> MeasuredTable {
    read(written(columns), &Form::default(), BOUND).unwrap()
}

fn row(table: &MeasuredTable, row: usize) -> Vec<Cell<'_>> {
    let columns = 0..table.columns().len();
    columns.map(|column| table.cell(row, column)).collect()
}

#[test]
fn numbers_texts_and_times_of_every_type() {
    let decimal =
        Decimal128Array::from(vec![Some(112_843), None]).with_precision_and_scale(9, 5).unwrap();
    let table = table(vec![
        ("f32", Arc::new(Float32Array::from(vec![0.5, f32::INFINITY]))),
        ("u64", Arc::new(UInt64Array::from(vec![Some(u64::MAX), None]))),
        ("decimal", Arc::new(decimal)),
        ("time", Arc::new(TimestampMillisecondArray::from(vec![1_593_701_755_123, -1]))),
        ("flag", Arc::new(BooleanArray::from(vec![true, false]))),
        ("name", Arc::new(StringArray::from(vec![" P1 ", "2.5"]))),
        ("image", Arc::new(BinaryArray::from(vec![&b"a"[..], b"b"]))),
    ]);
    assert_eq!(table.columns(), ["f32", "u64", "decimal", "time", "flag", "name"]);
    assert_eq!(table.remarks, ["column \"image\" holds Binary and is no column of the table"]);
    let first = [
        Number(0.5),
        Number(u64::MAX as f64),
        Number(1.128_43),
        Number(1_593_701_755_123_000_000.0),
        Text("true"),
        Text("P1"),
    ];
    assert_eq!(row(&table, 0), first);
    let [Number(infinite), Blank, Blank, Number(time), Text("false"), Number(2.5)] =
        row(&table, 1)[..]
    else {
        panic!("{:?}", row(&table, 1));
    };
    assert!(infinite.is_nan());
    assert_eq!(Number(time), Number(-1e6));
    assert_eq!((table.line(1), table.counted), (2, Counted::Row));
}

#[test]
fn lists_and_structs_are_columns_of_their_own() {
    let joints = vec![Some(vec![Some(1.0), None]), None, Some(vec![Some(3.0), Some(4.0)])];
    let joints = ListArray::from_iter_primitive::<Float64Type, _, _>(joints);
    let fixed = vec![Some(vec![Some(1), Some(2)]), Some(vec![Some(3), Some(4)]), None];
    let fixed = FixedSizeListArray::from_iter_primitive::<Int32Type, _, _>(fixed, 2);
    let x: ArrayRef = Arc::new(Int32Array::from(vec![7, 8, 9]));
    let pose = StructArray::from(vec![(Arc::new(Field::new("x", DataType::Int32, true)), x)]);
    let table =
        table(vec![("q", Arc::new(joints)), ("pose", Arc::new(pose)), ("fixed", Arc::new(fixed))]);
    assert_eq!(table.columns(), ["q[0]", "q[1]", "pose.x", "fixed[0]", "fixed[1]"]);
    assert_eq!(
        row(&table, 0),
        [1.0, 0.0, 7.0, 1.0, 2.0].map(|number| if number == 0.0 { Blank } else { Number(number) })
    );
    assert_eq!(row(&table, 1)[..3], [Blank, Blank, Number(8.0)]);
    assert_eq!(row(&table, 2), [Number(3.0), Number(4.0), Number(9.0), Blank, Blank]);
}

#[test]
fn damaged_files_and_those_that_grow_are_refused() {
    let zeros: ArrayRef = Arc::new(Float64Array::from(vec![0.0; 4_000_000]));
    let bytes = written(vec![("x", zeros)]);
    let told = read(bytes.clone(), &Form::default(), BOUND).unwrap_err().to_string();
    assert!(told.contains("unpacked it has more than 16777216 bytes"), "{told}");
    let packed = wrong("Disabled feature at compile time: flate2").to_string();
    assert!(packed.ends_with("write it with snappy, zstd or no compression"));
    for length in [4, 8, 100, bytes.len() - 9] {
        assert!(read(bytes[..length].to_vec(), &Form::default(), BOUND).is_err());
    }
}
