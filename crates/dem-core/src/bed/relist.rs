//! A new neighbour list for a bed whose particles have moved.

use super::contact::Memory;
use super::engine::{Bed, Pairs};
use super::error::BedError;
use super::motion::WallList;
use super::neighbours::{index_of, sort_and_list};
use super::vec3::{ZERO, scale};

impl Bed {
    /// Rebuilds the neighbour list; contacts keep their memory.
    pub(crate) fn rebuild(&mut self) -> Result<(), BedError> {
        self.work.rebuilds += 1;
        let old = std::mem::take(&mut self.list);
        let old_walls = std::mem::take(&mut self.wall_list);
        let (list, order) = sort_and_list(&mut self.particles, &self.around.region, self.skin);
        let n = self.particles.len();
        let mut place = vec![0u32; n];
        for (new, &before) in order.iter().enumerate() {
            place[before as usize] = new as u32;
        }
        let pairs = list.other.len();
        let spins = if self.rotates() { pairs } else { 0 };
        let necks = if self.has_necks() { pairs } else { 0 };
        let mut fresh = Pairs {
            memory: vec![Memory::APART; pairs],
            plastic_before: vec![0.0; pairs],
            force: vec![ZERO; pairs],
            constants: Vec::new(),
            spring: vec![ZERO; spins],
            torque: vec![ZERO; spins],
            turn: vec![ZERO; necks],
            moment: vec![ZERO; necks],
        };
        for i in 0..n {
            for k in old.row(i) {
                if !self.pairs.memory[k].is_contact() {
                    continue;
                }
                let (a, b) = (place[i] as usize, place[index_of(old.other[k])] as usize);
                // A contact is always near enough to be in the new list.
                let Some(to) = list.find(a.min(b), a.max(b)) else { continue };
                fresh.memory[to] = self.pairs.memory[k];
                fresh.plastic_before[to] = self.pairs.plastic_before[k];
                if spins > 0 {
                    let sign = if a < b { 1.0 } else { -1.0 };
                    fresh.spring[to] = scale(self.pairs.spring[k], sign);
                    if necks > 0 {
                        fresh.turn[to] = scale(self.pairs.turn[k], sign);
                    }
                }
            }
        }
        self.pairs = fresh;
        self.list = list;
        self.wall_list = self.list_walls(&old_walls, &order);
        self.listed_position.clone_from(&self.particles.position_m);
        self.travelled = 0.0;
        self.fill_constants()
    }

    fn list_walls(&self, old: &WallList, order: &[u32]) -> WallList {
        let mut list = WallList { start: vec![0], ..WallList::default() };
        for (i, &before) in order.iter().enumerate() {
            for (index, wall) in self.walls.iter().enumerate() {
                let reach = self.particles.radius_m[i] + self.skin;
                if wall.distance(self.particles.position_m[i]) >= reach {
                    continue;
                }
                let same = old.row(before as usize).find(|&k| old.wall[k] as usize == index);
                list.wall.push(index as u8);
                list.memory.push(same.map_or(Memory::APART, |k| old.memory[k]));
                if self.rotates() {
                    list.spring.push(same.map_or(ZERO, |k| old.spring[k]));
                }
            }
            list.start.push(list.wall.len() as u32);
        }
        list
    }
}
