//! Light groups: the picture has a separate layer for the light of each group.

/// Maximum number of groups in a scene; each group takes memory in every pixel.
pub const MAX_GROUPS: usize = 64;
/// Maximum length of a group's name in letters. `ViewLayer.CombinedLightGroup_NAME.R` then has 63 letters, Blender's
/// limit for a channel name.
pub const MAX_GROUP_NAME: usize = 32;

/// Index of a light group in its scene, or no group.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Group(u8);

impl Group {
    /// No group.
    pub const NONE: Group = Group(0);

    /// The group with an index below [`MAX_GROUPS`].
    pub fn new(index: usize) -> Group {
        Group(u8::try_from(index + 1).unwrap_or(0))
    }

    /// The index of the group; `None` for [`Group::NONE`].
    #[inline]
    pub fn index(self) -> Option<usize> {
        self.0.checked_sub(1).map(usize::from)
    }
}

/// The light groups of a scene, and the group of each light.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Groups {
    /// Names of the groups in the names of layers: unique, of ASCII letters, digits and `_`.
    pub names: Vec<String>,
    /// Names of the groups in the scene file.
    labels: Vec<String>,
    /// Group of each emissive instance, by the index of the instance.
    pub instances: Vec<Group>,
    /// Groups of points, spots and suns, in the order of the emitters.
    pub others: Vec<Group>,
    /// Group of the environment.
    pub environment: Group,
}

impl Groups {
    /// The group with the name `label` in the scene file, added if it is new. `None` if there are [`MAX_GROUPS`]
    /// others.
    pub fn get_or_add(&mut self, label: &str) -> Option<Group> {
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

    /// Groups whose names were truncated or numbered: the name in the scene file, and the name in layers.
    pub fn renamed(&self) -> impl Iterator<Item = (&str, &str)> {
        let pairs = self.labels.iter().zip(&self.names);
        pairs.filter(|(label, name)| legal(label) != **name).map(|(label, name)| (&**label, &**name))
    }

    /// A unique layer name for a label: illegal letters become `_`, long names are truncated, and names that are taken
    /// get a number.
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

/// Replaces every letter that a layer's name cannot have by `_`.
fn legal(label: &str) -> String {
    label.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_become_legal_names_and_the_number_of_groups_is_limited() {
        let mut groups = Groups::default();
        let [key, rim, other, again] =
            ["Key light", "rim", "Key.light", "Key light"].map(|name| groups.get_or_add(name));
        assert_eq!((key, rim, again), (Some(Group::new(0)), Some(Group::new(1)), key));
        assert_eq!(other, Some(Group::new(2)));
        assert_eq!(groups.names, ["Key_light", "rim", "Key_light_2"]);
        assert_eq!(groups.renamed().collect::<Vec<_>>(), [("Key.light", "Key_light_2")]);
        assert_eq!((Group::NONE.index(), Group::new(63).index()), (None, Some(63)));
        (3..MAX_GROUPS).for_each(|index| assert!(groups.get_or_add(&index.to_string()).is_some()));
        assert_eq!(groups.get_or_add("one more"), None);
    }

    #[test]
    fn names_are_short_legal_and_unique_for_any_labels() {
        let mut groups = Groups::default();
        let long = "a".repeat(40);
        let labels = ["\u{4e3b}\u{5149}", "\u{9006}\u{5149}", "__", "___2", &long, &long[1..], &long[..32], "a_2", ""];
        let of: Vec<_> = labels.iter().map(|label| groups.get_or_add(label).and_then(Group::index)).collect();
        assert_eq!(of, (0..labels.len()).map(Some).collect::<Vec<_>>());
        let mut names = groups.names.clone();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), labels.len(), "{:?}", groups.names);
        let legal = |c: char| c.is_ascii_alphanumeric() || c == '_';
        assert!(names.iter().all(|name| name.len() <= MAX_GROUP_NAME && name.chars().all(legal)), "{names:?}");
    }
}
