//! Part of the Protobuf encoding that messages for viewers need:
//! <https://protobuf.dev/programming-guides/encoding/>.

const VARINT: u64 = 0;
const FIXED_64: u64 = 1;
const BYTES: u64 = 2;
const FIXED_32: u64 = 5;

/// Message written field by field; zero numbers are omitted, as the encoding prescribes.
#[derive(Default)]
pub(crate) struct Message(Vec<u8>);

impl Message {
    pub(crate) fn bytes(&self) -> &[u8] {
        &self.0
    }

    pub(crate) fn into_bytes(self) -> Vec<u8> {
        self.0
    }

    fn varint(&mut self, mut value: u64) {
        while value > 0x7f {
            self.0.push(value as u8 | 0x80);
            value >>= 7;
        }
        self.0.push(value as u8);
    }

    fn tag(&mut self, field: u64, kind: u64) {
        debug_assert!(field > 0 && kind < 8);
        self.varint(field << 3 | kind);
    }

    pub(crate) fn integer(mut self, field: u64, value: u64) -> Self {
        if value != 0 {
            self.tag(field, VARINT);
            self.varint(value);
        }
        self
    }

    pub(crate) fn fixed(mut self, field: u64, value: u32) -> Self {
        if value != 0 {
            self.tag(field, FIXED_32);
            self.0.extend(value.to_le_bytes());
        }
        self
    }

    pub(crate) fn number(mut self, field: u64, value: f64) -> Self {
        if value != 0.0 {
            self.tag(field, FIXED_64);
            self.0.extend(value.to_le_bytes());
        }
        self
    }

    pub(crate) fn numbers(self, field: u64, values: impl Iterator<Item = f64>) -> Self {
        let packed: Vec<u8> = values.flat_map(f64::to_le_bytes).collect();
        if packed.is_empty() { self } else { self.data(field, &packed) }
    }

    pub(crate) fn data(mut self, field: u64, data: &[u8]) -> Self {
        self.tag(field, BYTES);
        self.varint(data.len() as u64);
        self.0.extend_from_slice(data);
        self
    }

    pub(crate) fn text(self, field: u64, text: &str) -> Self {
        self.data(field, text.as_bytes())
    }

    pub(crate) fn part(self, field: u64, part: &Self) -> Self {
        self.data(field, &part.0)
    }

    pub(crate) fn parts(self, field: u64, parts: impl IntoIterator<Item = Self>) -> Self {
        parts.into_iter().fold(self, |message, part| message.part(field, &part))
    }
}

/// Returns the last text of `message` in `field`, empty if there is none; `None` if `message` is
/// malformed.
pub(crate) fn text_in(message: &[u8], field: u64) -> Option<String> {
    let (mut rest, mut found) = (message, &[][..]);
    while !rest.is_empty() {
        let tag = read_varint(&mut rest)?;
        let length = match tag & 7 {
            VARINT => {
                read_varint(&mut rest)?;
                0
            }
            FIXED_64 => 8,
            FIXED_32 => 4,
            BYTES => usize::try_from(read_varint(&mut rest)?).ok()?,
            _ => return None,
        };
        let (value, behind) = rest.split_at_checked(length)?;
        rest = behind;
        if tag == field << 3 | BYTES {
            found = value;
        }
    }
    String::from_utf8(found.to_vec()).ok()
}

fn read_varint(bytes: &mut &[u8]) -> Option<u64> {
    let mut value = 0;
    for shift in (0..64).step_by(7) {
        let (&byte, rest) = bytes.split_first()?;
        *bytes = rest;
        value |= u64::from(byte & 0x7f) << shift;
        if byte < 0x80 {
            return Some(value);
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_text_is_found_behind_fields_of_all_kinds_and_none_in_half_a_message() {
        let message = Message::default()
            .part(1, &Message::default().integer(1, u64::MAX))
            .integer(2, 300)
            .fixed(3, 7)
            .number(5, 0.5)
            .numbers(6, [1.0, 2.0].into_iter())
            .text(4, "mapper");
        assert_eq!(text_in(message.bytes(), 4).as_deref(), Some("mapper"));
        assert_eq!(text_in(message.bytes(), 7).as_deref(), Some(""));
        let cut = &message.bytes()[..message.bytes().len() - 1];
        assert_eq!(text_in(cut, 4), None);
        assert_eq!(text_in(&[0xff; 20], 4), None);
    }
}
