//! A named array of tuples, one tuple a point.

/// The numbers of an array, tuple after tuple.
#[derive(Clone, Debug, PartialEq)]
#[allow(missing_docs)]
pub enum Values {
    I8(Vec<i8>),
    U8(Vec<u8>),
    I16(Vec<i16>),
    U16(Vec<u16>),
    I32(Vec<i32>),
    U32(Vec<u32>),
    I64(Vec<i64>),
    U64(Vec<u64>),
    F32(Vec<f32>),
    F64(Vec<f64>),
}

/// A named array of tuples.
#[derive(Clone, Debug, PartialEq)]
pub struct Array {
    /// What the array holds, `ambient_occlusion` say.
    pub name: String,
    /// Numbers a tuple; at least 1.
    pub components: usize,
    /// `components` numbers a point, point after point.
    pub values: Values,
}
