//! The phase of whole turns: each is asked for until it counts.

use super::{Phased, Wizard};
use crate::event::{Event, UserRequest};
use crate::folder::Part;
use crate::spin::{Spin, TURNS};
use crate::unit_session::UnitSession;

impl Wizard<'_> {
    /// Asks for the whole turns of a part that are missing, if the session has any.
    pub async fn whole_turns(&mut self, part: Part) -> Phased<()> {
        let Some(stated) = self.config.whole_turns else {
            return Ok(());
        };
        if !self.units.iter().all(UnitSession::can_count) {
            let words = "whole turns are left out: the poses do not determine the gyro, so that its turns cannot be counted";
            self.tell(Event::Note {
                words: words.into(),
            });
            return Ok(());
        }
        let all = Spin::all(part, stated.turns.unwrap_or(TURNS));
        let (mut later, mut left_out) = (Vec::new(), Vec::new());
        self.planned = all.len();
        loop {
            let mut left = self.spins_left(part, &all);
            left.retain(|spin| !left_out.contains(spin));
            left.sort_by_key(|spin| later.contains(spin));
            let Some(spin) = left.first().copied() else {
                break;
            };
            let done = self.spin(part, spin, all.len() - left.len()).await?;
            match later.contains(&spin) {
                _ if done => {}
                true => left_out.push(spin),
                false => later.push(spin),
            }
        }
        self.units.iter_mut().for_each(UnitSession::end_spins);
        self.current = None;
        Ok(())
    }

    /// Those of `all` that a unit lacks.
    fn spins_left(&self, part: Part, all: &[Spin]) -> Vec<Spin> {
        let each = self.units.iter();
        let left = each.map(|u| Spin::left(part, all, &u.folder.spins(part)));
        left.max_by_key(Vec::len).unwrap_or_default()
    }

    /// Whether a spin was made, and not skipped.
    async fn spin(&mut self, part: Part, spin: Spin, done: usize) -> Phased<bool> {
        let step = spin.rest(self.config.dwell_s);
        self.current = Some(step);
        self.tell(Event::Spin {
            part,
            done,
            planned: self.planned,
            spin,
            step,
            words: spin.words(),
        });
        let limit_deg = self.config.fixture.tolerance_deg();
        let asked = self.units.iter_mut();
        let rested: Vec<Event> = asked
            .filter_map(|unit| unit.ask_for_spin(spin, limit_deg))
            .collect();
        for event in rested {
            self.tell(event);
        }
        while !self.units.iter().all(|u| u.done) {
            match self.round(Some(&step), false).await? {
                Some(UserRequest::Skip) => return Ok(false),
                Some(UserRequest::RedoLast | UserRequest::Redo(_)) => {
                    self.units.iter_mut().for_each(UnitSession::restart_spin);
                    let words = "from the beginning: put it against the edge, and let it rest";
                    self.tell(Event::Note {
                        words: words.into(),
                    });
                }
                Some(UserRequest::Cancel) | None => {}
            }
        }
        Ok(true)
    }
}
