use std::collections::BTreeMap;

/// The number of messages of each channel; ids are dense in most logs.
#[derive(Debug, Default)]
pub(super) struct Counts {
    of: Vec<u64>,
    met: Vec<u16>,
}

impl Counts {
    pub fn add(&mut self, channel: u16, messages: u64) {
        let place = usize::from(channel);
        if self.of.len() <= place {
            self.of.resize(place + 1, 0);
        }
        if self.of[place] == 0 && messages > 0 {
            self.met.push(channel);
        }
        self.of[place] = self.of[place].saturating_add(messages);
    }

    pub fn of(&self, channel: u16) -> u64 {
        self.of.get(usize::from(channel)).copied().unwrap_or(0)
    }

    pub fn all(&self) -> u64 {
        let of_channels = self.met.iter().map(|&channel| self.of(channel));
        of_channels.fold(0, u64::saturating_add)
    }

    pub(super) fn by_channel(&self) -> BTreeMap<u16, u64> {
        self.met.iter().map(|&channel| (channel, self.of(channel))).collect()
    }

    pub fn clear(&mut self) {
        for channel in self.met.drain(..) {
            self.of[usize::from(channel)] = 0;
        }
    }
}
