use super::*;

/// Pass that fills numbers with random bytes and lists with random lengths. One-byte numbers are 0
/// or 1, which suits flags.
struct Random(u64, Release);

impl Random {
    fn next(&mut self) -> u64 {
        for shift in [12, 25, 27] {
            self.0 ^= if shift == 25 { self.0 << shift } else { self.0 >> shift };
        }
        self.0.wrapping_mul(0x2545_F491_4F6C_DD1D)
    }
}

impl Pass for Random {
    fn release(&self) -> Release {
        self.1
    }

    fn number<const N: usize>(&mut self, bytes: &mut [u8; N]) -> Result<(), Malformed> {
        *bytes = std::array::from_fn(|_| if N == 1 { self.next() % 2 } else { self.next() } as u8);
        Ok(())
    }

    fn length(&mut self, _: usize, most: usize) -> Result<usize, Malformed> {
        Ok(self.next() as usize % 4.min(most.saturating_add(1)))
    }
}

struct Big(Vec<u8>, Release);

impl Pass for Big {
    fn release(&self) -> Release {
        self.1
    }

    fn number<const N: usize>(&mut self, bytes: &mut [u8; N]) -> Result<(), Malformed> {
        self.0.resize((self.0.len() - 4).next_multiple_of(N) + 4, 0);
        self.0.extend(bytes.iter().rev());
        Ok(())
    }

    fn length(&mut self, length: usize, most: usize) -> Result<usize, Malformed> {
        (length as u32).pass(self, most)?;
        Ok(length)
    }
}

fn each_release<T: Cdr + Clone + Default>(test: impl Fn(T, Release, &mut Random)) {
    for seed in 1..20 {
        for (_, release) in Release::ALL {
            let mut random = Random(seed, release);
            // A text may lack its end.
            let message = std::iter::repeat_with(|| {
                let mut message = T::default();
                message.pass(&mut random, usize::MAX).map(|()| message).ok()
            });
            let message = message.flatten().next().unwrap();
            test(message, release, &mut random);
        }
    }
}

fn round_trip<T: Cdr + Clone + Default>() {
    each_release(|message: T, release, _| {
        let little = message.clone().encode_for(release);
        let mut big = Big(vec![0; 4], release);
        message.clone().pass(&mut big, usize::MAX).unwrap();
        for bytes in [&little, &big.0] {
            let (read, is_whole) = crate::cdr::read::<T>(bytes, release).unwrap();
            assert!(is_whole && read.encode_for(release) == little, "{release:?} {bytes:?}");
        }
    });
}

fn hostile<T: Cdr + Clone + Default>() {
    each_release(|message: T, release, random| {
        let mut bytes = message.encode_for(release);
        for _ in 0..20 {
            let (at, byte) = (random.next() as usize % bytes.len(), random.next() as u8);
            let before = std::mem::replace(&mut bytes[at], byte);
            if let Ok((read, _)) = crate::cdr::read::<T>(&bytes, release) {
                // Invalid UTF-8 in a text is replaced by three bytes.
                assert!(read.encode_for(release).len() <= 4 * bytes.len());
            }
            bytes[at] = before;
            let _ = T::decode(&bytes[..at]);
        }
    });
}

#[test]
fn every_message_of_every_release_and_byte_order_is_read_as_it_was_written() {
    each_message!(round_trip);
}

#[test]
fn no_bytes_make_a_message_panic_or_grow_beyond_them() {
    each_message!(hostile);
    let long = [&[0, 1, 0, 0][..], &[255; 4], &[0; 64]].concat();
    assert_eq!(TFMessage::decode(&long), Err(Malformed::Short));
    let name = [&[0, 1, 0, 0][..], &[0; 8], &[1, 1, 0, 0], &[65; 300]].concat();
    assert_eq!(Header::decode(&name), Err(Malformed::Long(257, LONGEST_TEXT)));
    assert_eq!(Bool::decode(&[0, 1, 0, 0, 2]), Err(Malformed::Bool(2)));
}
