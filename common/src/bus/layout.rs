//! How payloads lie in memory, for programs in other languages: names, types and offsets of all fields.

use super::payload::{Payload, type_name};

/// A payload, or a part of one, whose layout is known.
pub trait Layout {
    /// What it is made of.
    fn kind() -> Kind;
}

/// What a field is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A number; its name in Rust.
    Number(&'static str),
    /// So many of one kind.
    Array(Box<Self>, usize),
    /// A struct.
    Struct(Structure),
}

/// A `repr(C)` struct.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Structure {
    /// Its name for every language: `firsthand.Pose`.
    pub name: &'static str,
    /// Bytes.
    pub size: usize,
    /// In their order.
    pub fields: Vec<Field>,
}

/// A field of a struct.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Field {
    /// Its name.
    pub name: &'static str,
    /// Bytes from the start of the struct.
    pub offset: usize,
    /// What it is.
    pub kind: Kind,
}

impl Structure {
    /// Of `P`, which has these fields.
    pub(crate) fn of<P: Payload>(fields: Vec<Field>) -> Kind {
        Kind::Struct(Self {
            name: type_name::<P>(),
            size: size_of::<P>(),
            fields,
        })
    }
}

/// What the field is that a struct's accessor gives.
pub(crate) fn kind_of<P, F: Layout>(_: fn(&P) -> &F) -> Kind {
    F::kind()
}

macro_rules! numbers {
    ($($number:ident)*) => {$(
        impl Layout for $number {
            fn kind() -> Kind {
                Kind::Number(stringify!($number))
            }
        }
    )*};
}

numbers!(u8 u16 u32 u64 i32 f32 f64);

impl<T: Layout, const N: usize> Layout for [T; N] {
    fn kind() -> Kind {
        Kind::Array(Box::new(T::kind()), N)
    }
}

/// The fields of structs, all of them: one that is missing here does not compile.
macro_rules! layouts {
    ($($payload:ident { $($field:ident)* })*) => {$(
        impl $crate::bus::Layout for $payload {
            fn kind() -> $crate::bus::Kind {
                let _all = |&Self { $($field: _),* }: &Self| ();
                $crate::bus::Structure::of::<Self>(vec![$($crate::bus::Field {
                    name: stringify!($field),
                    offset: std::mem::offset_of!(Self, $field),
                    kind: $crate::bus::kind_of(|payload: &Self| &payload.$field),
                }),*])
            }
        }
    )*};
}
pub(crate) use layouts;
