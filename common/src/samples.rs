//! Payloads of [`crate::topics`] in shared memory: `repr(C)`, without pointers, with units in each
//! name or doc. Attaching checks size and `type_name`, for other languages.
//!
//! Why `unsafe` is allowed here: deriving `ZeroCopySend` writes an `unsafe impl`, which promises a
//! self-contained type of uniform layout. All fields are plain numbers and arrays of them, in
//! `repr(C)` structs.
//!
//! Another process may write any bit pattern, so states are bytes, read through `from_byte`.
#![allow(unsafe_code)]

pub use bus::{Stamp, Stamped};

/// Declares structs for shared memory, each with a name for other languages. A field without a
/// default is 0. A byte `as` a state has a getter of its name.
#[macro_export]
macro_rules! structs {
    (@) => { $crate::bus::Layout::zero() };
    (@ $default:expr) => { $default };
    ($($(#[$meta:meta])* $type_name:literal $name:ident { $($(#[doc = $doc:literal])* $field:ident: $kind:ty $(as $state:ty)? $(= $default:expr)?,)* })*) => {$(
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, PartialEq, $crate::bus::ZeroCopySend)]
        #[type_name($type_name)]
        #[repr(C)]
        pub struct $name {
            $($(#[doc = $doc])* pub $field: $kind,)*
        }

        impl $name {
            $($(pub const fn $field(&self) -> $state {
                <$state>::from_byte(self.$field)
            })?)*
        }

        impl Default for $name {
            fn default() -> Self {
                Self { $($field: $crate::structs!(@ $($default)?),)* }
            }
        }

        $crate::bus::layouts! { $name { $($field [$($doc)*])* } }
    )*};
}

/// Declares payloads of topics: [`structs`] that begin with a [`Stamp`]. The declaration suffices
/// to write, read, show and record them. `ZeroCopySend` must be in scope.
#[macro_export]
macro_rules! payloads {
    ($($(#[$meta:meta])* $type_name:literal $name:ident { $($fields:tt)* })*) => {$(
        $crate::structs! { $(#[$meta])* $type_name $name { stamp: $crate::bus::Stamp, $($fields)* } }

        impl $crate::bus::Stamped for $name {
            fn stamp(&self) -> &$crate::bus::Stamp {
                &self.stamp
            }
            fn stamp_mut(&mut self) -> &mut $crate::bus::Stamp {
                &mut self.stamp
            }
        }
    )*};
}

// These modules use the macros above.
mod localisation;
mod navigation;
mod robot;
mod supervision;

pub use self::{localisation::*, navigation::*, robot::*, supervision::*};

#[cfg(test)]
mod tests {
    use bus::{decode_sample, decode_slice, encode_sample, encode_slice};

    use super::*;

    #[test]
    fn an_unknown_byte_is_read_as_the_safe_state() {
        assert_eq!(Order::from_byte(200), Order::Stop);
        assert_eq!(CommandState::from_byte(200), CommandState::Halt);
        assert_eq!(GuidanceStatus::from_byte(200), GuidanceStatus::Waiting);
        assert_eq!(Maneuver::from_byte(200), Maneuver::Stand);
        assert_eq!(RangeStatus::from_byte(200), RangeStatus::Absent);
        assert_eq!(Action::from_byte(200), Action::Stop);
    }

    #[test]
    fn names_survive_shared_memory() {
        assert_eq!(name_str(&name("dead-reckoning")), "dead-reckoning");
        assert_eq!(name_str(&name(&"x".repeat(40))).len(), 24);
        assert_eq!(name_str(&[0xff; 24]), "");
    }

    #[test]
    fn a_sample_is_read_as_it_was_written_and_none_from_half_of_it() {
        let mut link = LinkSample { losses: 7, ..LinkSample::default() };
        link.latency_histogram[3] = 11;
        let mut message = Vec::new();
        encode_sample(&link, &mut message);
        assert_eq!(decode_sample(&message), Some(link));
        message.pop();
        assert_eq!(decode_sample::<LinkSample>(&message), None);
    }

    #[test]
    fn a_slice_is_read_as_it_was_written_and_none_where_its_length_is_a_lie() {
        let cells = [FieldCell::default(); 3];
        let mut message = Vec::new();
        encode_slice(&FieldHeader::default(), &cells, &mut message);
        let read = decode_slice::<FieldHeader, FieldCell>(&message);
        assert_eq!(read, Some((FieldHeader::default(), cells.to_vec())));
        let length = message.len() - 3 * 12 - 4;
        message[length..length + 4].copy_from_slice(&u32::MAX.to_le_bytes());
        assert_eq!(decode_slice::<FieldHeader, FieldCell>(&message), None);
    }
}
