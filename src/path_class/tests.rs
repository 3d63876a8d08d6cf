use super::*;

/// All paths of at most `most` scattering events.
fn paths(most: usize) -> Vec<Vec<Event>> {
    let mut all = vec![vec![]];
    let mut last = all.clone();
    for _ in 0..most {
        last = last
            .iter()
            .flat_map(|path: &Vec<Event>| Event::ALL.map(|event| [path.as_slice(), &[event]].concat()))
            .collect();
        all.extend(last.iter().cloned());
    }
    all
}

fn letters(path: &[Event]) -> String {
    let letter = |event: &Event| match event {
        Event::Clear => 'C',
        Event::Mirror => 'M',
        Event::Sharp => 'S',
        Event::Broad => 'B',
        Event::Medium => 'V',
    };
    path.iter().map(letter).collect()
}

/// The classes of the table in `path_class` that a path, written in Heckbert's notation, matches, by string
/// operations alone. `sizeless`: it ends on a delta light.
fn rows(path: &str, sizeless: bool) -> Vec<PathClass> {
    use PathClass as C;
    let rest = path.trim_start_matches('C');
    let narrow = |s: &str| s.chars().all(|c| "CMS".contains(c));
    let delta = |s: &str| s.chars().all(|c| "CM".contains(c));
    let glossy = rest.starts_with(['M', 'S']);
    let broadly = path.ends_with(['B', 'V']);
    let spreads = path.matches(['B', 'V']).count();
    // `prefix B N+`, where `B` is the only broad lobe.
    let focus = path.split_once('B').filter(|(before, after)| narrow(before) && narrow(after) && !after.is_empty());
    let spark = path.rsplit_once('S').filter(|(before, after)| narrow(before) && delta(after) && !after.is_empty());
    let caustic = focus.or(spark.filter(|_| sizeless)).map(|(before, _)| before);
    let table = [
        (C::Emission, rest.is_empty()),
        (C::Direct, rest == "B"),
        (C::Highlight, rest == "S"),
        (C::Coat, rest.starts_with('M') && delta(rest)),
        (C::Reflection, glossy && narrow(rest) && rest != "S" && !delta(rest) && caustic.is_none()),
        (C::ReflectedDirect, glossy && broadly && spreads == 1),
        (C::ReflectedIndirect, glossy && broadly && spreads > 1),
        (C::ReflectedFocus, glossy && !broadly && spreads > 0 && caustic.is_none()),
        (C::Indirect, rest.starts_with('B') && broadly && rest != "B"),
        (C::IndirectFocus, rest.starts_with('B') && !broadly && caustic.is_none()),
        (C::Caustic, caustic == Some("")),
        (C::Sds, caustic.is_some_and(|before| !before.is_empty())),
        (C::Single, rest == "V"),
        (C::Volume, rest.starts_with('V') && rest != "V"),
    ];
    table.into_iter().filter(|(_, is)| *is).map(|(class, _)| class).collect()
}

#[test]
fn every_path_is_in_exactly_one_class() {
    let mut seen = ClassSet::NONE;
    for path in paths(6) {
        for sizeless in [false, true] {
            let class = PathClass::of(path.iter().copied(), sizeless);
            assert_eq!(rows(&letters(&path), sizeless), [class], "{} {sizeless}", letters(&path));
            seen = seen.and(ClassSet::one(class));
        }
    }
    assert!(seen.is_all());
}

/// A path has the same class for every split into a camera path and a light path.
#[test]
fn camera_and_light_path_determine_the_class_of_the_whole_path() {
    for path in paths(6) {
        for sizeless in [false, true] {
            let whole = PathClass::of(path.iter().copied(), sizeless);
            // The two paths join at a vertex with a lobe that is not a delta lobe.
            for (at, _) in path.iter().enumerate().filter(|(_, event)| !matches!(event, Event::Clear | Event::Mirror)) {
                let camera = path[..=at].iter().fold(CameraSuffix::START, |camera, event| camera.then(*event));
                let light =
                    path[at + 1..].iter().rev().fold(LightPrefix::start(sizeless), |light, event| light.then(*event));
                assert_eq!(camera.class_with(light), whole, "{} {sizeless} at {at}", letters(&path));
            }
        }
    }
}

#[test]
fn reachable_classes_contain_the_class_of_every_continuation() {
    for path in paths(6) {
        for sizeless in [false, true] {
            let class = PathClass::of(path.iter().copied(), sizeless);
            let mut camera = CameraSuffix::START;
            for event in &path {
                assert!(camera.reachable_classes().has(class), "{}", letters(&path));
                camera = camera.then(*event);
            }
            assert!(camera.reachable_classes().has(class), "{}", letters(&path));
        }
    }
    let caustic = CameraSuffix::START.then(Event::Broad).then(Event::Clear);
    assert!(
        !caustic.reachable_classes().has(PathClass::Sds) && !caustic.reachable_classes().has(PathClass::Reflection)
    );
}

#[test]
fn sets_of_classes_contain_the_parts_and_effects_of_their_members() {
    let off: EffectSet = [Effect::Caustic, Effect::Sds].into_iter().collect();
    let on = ClassSet::without(off);
    assert!(!on.has_part(Part::Caustic) && on.has_part(Part::Indirect) && !on.is_all() && !on.is_empty());
    assert!(ClassSet::without(EffectSet::NONE).is_all());
    for class in PathClass::ALL {
        assert!(ClassSet::one(class).has(class) && ClassSet::one(class).has_part(class.part()));
        assert!(class.effect().is_class() || class.part() == Part::Volume);
    }
}
