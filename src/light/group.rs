//! Groups of lights, of which a picture tells the light apart.

/// Most groups of a scene: each takes memory in every pixel.
pub const MAX_GROUPS: usize = 64;
/// Most letters of a group's name in the names of layers: `ViewLayer.CombinedLightGroup_NAME.R` has 63 then, the most
/// that Blender holds.
pub const MAX_GROUP_NAME: usize = 32;

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
    /// Names, which end the names of layers: all different, of ASCII letters, digits and `_`.
    pub names: Vec<String>,
    /// Names in the scene.
    labels: Vec<String>,
    /// Of glowing instances.
    pub instances: Vec<Group>,
    /// Of lights that are no surfaces.
    pub others: Vec<Group>,
    /// Of the environment.
    pub environment: Group,
}

impl Groups {
    /// The group that the scene calls `label`, a new one where there is none; `None` where there are too many.
    pub fn named(&mut self, label: &str) -> Option<Group> {
        let index = match self.labels.iter().position(|known| known == label) {
            Some(index) => index,
            None if self.labels.len() == MAX_GROUPS => return None,
            None => {
                self.names.push(self.free_name(label));
                self.labels.push(label.to_owned());
                self.labels.len() - 1
            }
        };
        Some(Group::new(index))
    }

    /// Groups whose names are cut or numbered: what the scene calls them, and their names.
    pub fn renamed(&self) -> impl Iterator<Item = (&str, &str)> {
        let pairs = self.labels.iter().zip(&self.names);
        pairs.filter(|(label, name)| legal(label) != **name).map(|(label, name)| (&**label, &**name))
    }

    /// A name that no other group has: what a layer's name cannot have becomes `_`, what is too long is cut, and what
    /// is taken by another label gets a number.
    fn free_name(&self, label: &str) -> String {
        let letters = legal(label);
        let mut name = letters[..letters.len().min(MAX_GROUP_NAME)].to_owned();
        for number in 2.. {
            if !self.names.contains(&name) {
                break;
            }
            let suffix = format!("_{number}");
            name = letters[..letters.len().min(MAX_GROUP_NAME - suffix.len())].to_owned() + &suffix;
        }
        name
    }
}

/// A label with `_` for every letter that a layer's name cannot have.
fn legal(label: &str) -> String {
    label.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_become_names_of_layers_and_groups_are_no_more_than_there_is_room_for() {
        let mut groups = Groups::default();
        let [key, rim, other, again] = ["Key light", "rim", "Key.light", "Key light"].map(|name| groups.named(name));
        assert_eq!((key, rim, again), (Some(Group::new(0)), Some(Group::new(1)), key));
        assert_eq!(other, Some(Group::new(2)));
        assert_eq!(groups.names, ["Key_light", "rim", "Key_light_2"]);
        assert_eq!(groups.renamed().collect::<Vec<_>>(), [("Key.light", "Key_light_2")]);
        assert_eq!((Group::NONE.index(), Group::new(63).index()), (None, Some(63)));
        (3..MAX_GROUPS).for_each(|index| assert!(groups.named(&index.to_string()).is_some()));
        assert_eq!(groups.named("one more"), None);
    }

    /// Whatever the labels are, names are short, legal and different.
    #[test]
    fn names_are_different_whatever_the_labels() {
        let mut groups = Groups::default();
        let long = "a".repeat(40);
        let labels = ["\u{4e3b}\u{5149}", "\u{9006}\u{5149}", "__", "___2", &long, &long[1..], &long[..32], "a_2", ""];
        let of: Vec<_> = labels.iter().map(|label| groups.named(label).and_then(Group::index)).collect();
        assert_eq!(of, (0..labels.len()).map(Some).collect::<Vec<_>>());
        let mut names = groups.names.clone();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), labels.len(), "{:?}", groups.names);
        let legal = |c: char| c.is_ascii_alphanumeric() || c == '_';
        assert!(names.iter().all(|name| name.len() <= MAX_GROUP_NAME && name.chars().all(legal)), "{names:?}");
    }
}
