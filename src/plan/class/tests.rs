use super::*;

/// All paths of up to so many events.
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

/// The rows of the table that a path is in, read with string operations alone.
fn rows(path: &str, sizeless: bool) -> Vec<PathClass> {
    use PathClass as C;
    let rest = path.trim_start_matches('C');
    let narrow = |s: &str| s.chars().all(|c| "CMS".contains(c));
    let delta = |s: &str| s.chars().all(|c| "CM".contains(c));
    let glossy = rest.starts_with(['M', 'S']);
    let broadly = path.ends_with(['B', 'V']);
    let spreads = path.matches(['B', 'V']).count();
    // `prefix X N+`, X the only broad lobe.
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

/// However a path is put together of an eye's and a light's, its class is the same.
#[test]
fn halves_tell_the_class_of_the_whole() {
    for path in paths(6) {
        for sizeless in [false, true] {
            let whole = PathClass::of(path.iter().copied(), sizeless);
            // Where they meet is a vertex with a lobe that is not delta.
            for (at, _) in path.iter().enumerate().filter(|(_, event)| !matches!(event, Event::Clear | Event::Mirror)) {
                let sight = path[..=at].iter().fold(CameraSuffix::START, |sight, event| sight.then(*event));
                let beam =
                    path[at + 1..].iter().rev().fold(LightPrefix::start(sizeless), |beam, event| beam.then(*event));
                assert_eq!(sight.class_with(beam), whole, "{} {sizeless} at {at}", letters(&path));
            }
        }
    }
}

#[test]
fn nothing_is_ahead_that_was_not_told() {
    for path in paths(6) {
        for sizeless in [false, true] {
            let class = PathClass::of(path.iter().copied(), sizeless);
            let mut sight = CameraSuffix::START;
            for event in &path {
                assert!(sight.reachable_classes().has(class), "{}", letters(&path));
                sight = sight.then(*event);
            }
            assert!(sight.reachable_classes().has(class), "{}", letters(&path));
        }
    }
    let caustic = CameraSuffix::START.then(Event::Broad).then(Event::Clear);
    assert!(
        !caustic.reachable_classes().has(PathClass::Sds) && !caustic.reachable_classes().has(PathClass::Reflection)
    );
}

/// Parts and effects cut the same classes: no part but that of light which surfaces have scattered before holds more
/// than one effect, glossy and sds apart.
#[test]
fn sets_of_classes() {
    let off: EffectSet = [Effect::Caustic, Effect::Sds].into_iter().collect();
    let on = ClassSet::without(off);
    assert!(!on.has_part(Part::Caustic) && on.has_part(Part::Indirect) && !on.is_all() && !on.is_empty());
    assert!(ClassSet::without(EffectSet::NONE).is_all());
    for class in PathClass::ALL {
        assert!(ClassSet::one(class).has(class) && ClassSet::one(class).has_part(class.part()));
        assert!(class.effect().is_class() || class.part() == Part::Volume);
    }
}
