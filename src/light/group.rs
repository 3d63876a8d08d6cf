//! Groups of lights, of which a picture tells the light apart.

/// Most groups of a scene: each takes memory in every pixel.
pub const MAX_GROUPS: usize = 64;

/// A group by its place among the scene's; or none.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Group(u8);

impl Group {
    /// No group.
    pub const NONE: Group = Group(0);

    /// The group at this place, below [`MAX_GROUPS`].
    pub fn new(index: usize) -> Group {
        Group(u8::try_from(index + 1).unwrap_or(0))
    }

    /// Its place among the scene's groups.
    #[inline]
    pub fn index(self) -> Option<usize> {
        self.0.checked_sub(1).map(usize::from)
    }
}

/// What group each light of a scene is in.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Groups {
    /// Names, which are names of layers.
    pub names: Vec<String>,
    /// Of glowing instances.
    pub instances: Vec<Group>,
    /// Of lights that are no surfaces.
    pub others: Vec<Group>,
    /// Of the environment.
    pub environment: Group,
}

impl Groups {
    /// The group of a name, a new one where there is none; `None` where there are too many. What no layer's name can
    /// have becomes `_`.
    pub fn named(&mut self, name: &str) -> Option<Group> {
        let fit = |c: char| if c.is_ascii_alphanumeric() { c } else { '_' };
        let name: String = name.chars().map(fit).collect();
        let index = match self.names.iter().position(|known| *known == name) {
            Some(index) => index,
            None if self.names.len() == MAX_GROUPS => return None,
            None => {
                self.names.push(name);
                self.names.len() - 1
            }
        };
        Some(Group::new(index))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_become_names_of_layers_and_groups_are_no_more_than_there_is_room_for() {
        let mut groups = Groups::default();
        let [key, rim, again] = ["Key light", "rim", "Key.light"].map(|name| groups.named(name));
        assert_eq!((key, rim, again), (Some(Group::new(0)), Some(Group::new(1)), key));
        assert_eq!(groups.names, ["Key_light", "rim"]);
        assert_eq!((Group::NONE.index(), Group::new(63).index()), (None, Some(63)));
        (2..MAX_GROUPS).for_each(|index| assert!(groups.named(&index.to_string()).is_some()));
        assert_eq!(groups.named("one more"), None);
    }
}
