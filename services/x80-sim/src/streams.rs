//! The sensor streams that run, and the frames that each has left.

use common::wire::{Request, Stream};

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Run {
    ForEver,
    Frames(u8),
}

impl Run {
    const fn runs(self) -> bool {
        !matches!(self, Self::Frames(0))
    }

    fn take(&mut self) -> bool {
        match self {
            Self::ForEver => true,
            Self::Frames(0) => false,
            Self::Frames(left) => {
                *left -= 1;
                true
            }
        }
    }
}

/// All three run from boot.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Streams {
    motor: Run,
    custom: Run,
    standard: Run,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Due {
    pub(crate) motor: bool,
    pub(crate) custom: bool,
    pub(crate) standard: bool,
}

impl Default for Streams {
    fn default() -> Self {
        Self { motor: Run::ForEver, custom: Run::ForEver, standard: Run::ForEver }
    }
}

impl Streams {
    pub(crate) fn request(&mut self, stream: Stream, request: Request) {
        let run = match request {
            Request::Start => Run::ForEver,
            Request::Stop => Run::Frames(0),
            Request::Count(frames) => Run::Frames(frames),
        };
        let (motor, custom, standard) = match stream {
            Stream::Motor => (true, false, false),
            Stream::Custom => (false, true, false),
            Stream::Standard => (false, false, true),
            Stream::All => (true, true, true),
        };
        for (named, slot) in
            [(motor, &mut self.motor), (custom, &mut self.custom), (standard, &mut self.standard)]
        {
            if named {
                *slot = run;
            }
        }
    }

    /// One frame of each counts as sent.
    pub(crate) fn take(&mut self) -> Due {
        Due { motor: self.motor.take(), custom: self.custom.take(), standard: self.standard.take() }
    }

    pub(crate) const fn running(&self) -> Due {
        Due { motor: self.motor.runs(), custom: self.custom.runs(), standard: self.standard.runs() }
    }
}
