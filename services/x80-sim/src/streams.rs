use common::wire::{Request, Stream};

/// Frames left of the standard, custom and motor stream; none for unlimited. All run from boot.
#[derive(Default)]
pub struct Streams([Option<u8>; 3]);

impl Streams {
    pub fn request(&mut self, stream: Stream, request: Request) {
        let left = match request {
            Request::Start => None,
            Request::Stop => Some(0),
            Request::Count(frames) => Some(frames),
        };
        let named = match stream {
            Stream::Standard => 0..1,
            Stream::Custom => 1..2,
            Stream::Motor => 2..3,
            Stream::All => 0..3,
        };
        self.0[named].fill(left);
    }

    /// Returns the running streams and counts one frame of each as sent.
    pub fn take_due(&mut self) -> [bool; 3] {
        let due = self.running();
        for left in self.0.iter_mut().flatten() {
            *left = left.saturating_sub(1);
        }
        due
    }

    pub fn running(&self) -> [bool; 3] {
        self.0.map(|left| left != Some(0))
    }
}
