//! XML as a tree: OpenCV's storage, and that of unknown programs, with elements and attributes as fields and repeated elements as
//! a list.

use super::value::{MAX_DEPTH, MAX_VALUES, Value, number};

/// Descriptions of scenes and packages, whose poses are of parts; of robots by their links.
const OTHERS: [&str; 7] = ["mujoco", "sdf", "world", "package", "launch", "COLLADA", "svg"];

/// A document of XML, within bounds: its parser compares every attribute of an element with all others of it, and keeps the names
/// of spaces for every element again.
fn parsed(text: &str) -> Result<roxmltree::Document<'_>, String> {
    const MOST_ATTRIBUTES: usize = 256;
    const MOST_SPACES: usize = 64;
    // A tag ends at the next one at the latest; signs of equality in a text are counted with the tag before it.
    let attributes = |tag: &str| tag.split('>').next().map_or(0, |inside| inside.matches('=').count());
    if text.split('<').any(|tag| attributes(tag) > MOST_ATTRIBUTES) {
        return Err(format!("has an element with more than {MOST_ATTRIBUTES} attributes"));
    }
    if text.match_indices("xmlns").nth(MOST_SPACES).is_some() {
        return Err(format!("names more than {MOST_SPACES} spaces of names"));
    }
    let options = roxmltree::ParsingOptions { nodes_limit: MAX_VALUES as u32, ..roxmltree::ParsingOptions::default() };
    roxmltree::Document::parse_with_options(text, options).map_err(|e| e.to_string())
}

/// The values of OpenCV's storage in XML; `None` where it is not one.
pub(super) fn opencv(text: &str) -> Option<Value> {
    let document = parsed(text).ok()?;
    let root = document.root_element();
    let mut left = MAX_VALUES;
    root.has_tag_name("opencv_storage").then(|| of_storage(root, 0, &mut left)).flatten()
}

fn of_storage(node: roxmltree::Node<'_, '_>, depth: usize, left: &mut usize) -> Option<Value> {
    *left = left.checked_sub(1)?;
    if depth > MAX_DEPTH {
        return None;
    }
    let inner: Vec<_> = node.children().filter(roxmltree::Node::is_element).collect();
    if inner.is_empty() {
        let words: Vec<&str> = node.text().unwrap_or_default().split_whitespace().collect();
        let value = |word: &&str| number(word).map_or_else(|| Value::Text((*word).to_owned()), Value::Number);
        *left = left.checked_sub(words.len())?;
        return Some(match words.as_slice() {
            [] => Value::Other,
            [one] => value(one),
            many => Value::List(many.iter().map(value).collect()),
        });
    }
    let is_list = inner.iter().all(|node| node.has_tag_name("_"));
    let mut entries = Vec::with_capacity(inner.len());
    for node in inner {
        entries.push((node.tag_name().name().to_owned(), of_storage(node, depth + 1, left)?));
    }
    Some(if is_list { Value::List(entries.into_iter().map(|(_, value)| value).collect()) } else { Value::Map(entries) })
}

/// The fields of a document; `None` where it is not XML or describes something else.
pub(super) fn document(text: &str) -> Option<Value> {
    let document = parsed(text).ok()?;
    let root = document.root_element();
    if OTHERS.contains(&root.tag_name().name()) || root.children().any(|part| part.has_tag_name("link")) {
        return None;
    }
    let mut left = MAX_VALUES;
    of_node(root, 0, &mut left)
}

fn of_node(node: roxmltree::Node<'_, '_>, depth: usize, left: &mut usize) -> Option<Value> {
    *left = left.checked_sub(1)?;
    if depth > MAX_DEPTH {
        return None;
    }
    let text: String = node.children().filter_map(|inner| if inner.is_text() { inner.text() } else { None }).collect();
    let inner = node.children().filter(roxmltree::Node::is_element);
    let mut entries: Vec<(String, Vec<Value>)> = Vec::new();
    let mut places = std::collections::HashMap::new();
    let mut add = |name: &str, value: Value| {
        let place = *places.entry(name.to_owned()).or_insert_with(|| {
            entries.push((name.to_owned(), Vec::new()));
            entries.len() - 1
        });
        entries[place].1.push(value);
    };
    for attribute in node.attributes() {
        add(attribute.name(), scalar(attribute.value(), left)?);
    }
    for inner in inner {
        add(inner.tag_name().name(), of_node(inner, depth + 1, left)?);
    }
    if entries.is_empty() {
        return scalar(&text, left);
    }
    if !text.trim().is_empty() {
        entries.push(("value".to_owned(), vec![scalar(&text, left)?]));
    }
    let one_or_list =
        |mut values: Vec<Value>| if values.len() == 1 { values.swap_remove(0) } else { Value::List(values) };
    Some(Value::Map(entries.into_iter().map(|(name, values)| (name, one_or_list(values))).collect()))
}

/// Numbers, whatever separates them, or words.
fn scalar(text: &str, left: &mut usize) -> Option<Value> {
    let text = text.trim();
    let is_between = |c: char| c.is_whitespace() || matches!(c, ';' | '[' | ']' | '(' | ')');
    let words: Vec<&str> = text.split(is_between).filter(|word| !word.is_empty()).collect();
    *left = left.checked_sub(words.len())?;
    let mut numbers = Vec::new();
    for word in words {
        // One comma within a number is that of the countries that write it so; a list of two numbers is not part of a
        // pose.
        let with_comma = || (word.matches(',').count() == 1).then(|| number(&word.replace(',', "."))).flatten();
        if let Some(number) = number(word).or_else(with_comma) {
            numbers.push(number);
            continue;
        }
        for part in word.split(',').filter(|part| !part.is_empty()) {
            match number(part) {
                Some(number) => numbers.push(number),
                None => return Some(Value::Text(text.to_owned())),
            }
        }
    }
    Some(match numbers.as_slice() {
        [] => Value::Other,
        [one] => Value::Number(*one),
        many => Value::List(many.iter().map(|number| Value::Number(*number)).collect()),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::formats::tree;
    use crate::recording::{Numbers, Track};

    fn read(text: &str) -> Vec<Track> {
        tree::series(&document(text).expect("XML"), "log.xml")
    }

    #[test]
    fn records_are_read_whatever_their_elements_and_separators_are() {
        let want = |i: usize| Numbers::Angles([600.5, -412.25, i as f64, 2.5, -1.25, 0.5]);
        let forms: [fn(usize) -> String; 5] = [
            |i| {
                format!(
                    "<record><image>pics/a{i}.png</image><pose1>600.5</pose1><pose2>-412.25</pose2><pose3>{i}</pose3>\
                     <pose4>2.5</pose4><pose5>-1.25</pose5><pose6>0.5</pose6></record>"
                )
            },
            |i| {
                format!(
                    "<view file=\"pics/a{i}.png\" v0=\"600,5\" v1=\"-412,25\" v2=\"{i}\" v3=\"2,5\" v4=\"-1,25\" v5=\"0,5\"/>"
                )
            },
            |i| format!("<p><tcp>600.5 -412.25 {i} 2.5 -1.25 0.5</tcp><img src=\"pics/a{i}.png\"/></p>"),
            |i| format!("<p><tcp>[600.5, -412.25, {i}, 2.5, -1.25, 0.5]</tcp><img>pics/a{i}.png</img></p>"),
            |i| {
                format!(
                    "<v><robot x=\"600.5\" y=\"-412.25\" z=\"{i}\" rx=\"2.5\" ry=\"-1.25\" rz=\"0.5\"/>\
                     <path>pics/a{i}.png</path></v>"
                )
            },
        ];
        for (form, element) in forms.iter().enumerate() {
            let body: String = (1..5).map(element).collect();
            let tracks = read(&format!("<?xml version=\"1.0\"?>\n<log><made>by hand</made><all>{body}</all></log>"));
            let [track] = tracks.as_slice() else { panic!("{form}: {tracks:?}") };
            for (i, sample) in track.samples.iter().enumerate() {
                assert_eq!(sample.numbers, want(i + 1), "{form}");
                assert_eq!(sample.image, Some(format!("pics/a{}.png", i + 1)), "{form}");
            }
        }
    }

    #[test]
    fn opencv_writes_the_same_in_xml() {
        let text = "<?xml version=\"1.0\"?>\n<opencv_storage>\n<frameCount>2</frameCount>\n<T1_0 type_id=\"opencv-matrix\">\n  \
                    <rows>2</rows>\n<cols>2</cols>\n<dt>d</dt>\n  <data>\n    1. 2.5e-01 -3.\n    .5</data></T1_0>\n<list><_>\n  1 \
                    2</_><_>3 4</_></list></opencv_storage>";
        let value = opencv(text).expect("read");
        assert_eq!(value.get("T1_0").expect("there").numbers(16), Some(vec![1.0, 0.25, -3.0, 0.5]));
        assert_eq!(value.get("frameCount").and_then(Value::whole), Some(2));
        assert_eq!(value.get("list").map(|list| list.list().len()), Some(2));
        assert_eq!(opencv("<root><a>1</a></root>"), None);
    }

    /// Were any of these read in time that grows with the square of its length, this test would take hours.
    #[test]
    fn what_is_written_to_take_for_ever_is_refused_at_once() {
        let attributes = (0..1_000_000).map(|i| format!(" a{i}=\"\"")).collect::<Vec<_>>().concat();
        assert!(parsed(&format!("<opencv_storage{attributes}/>")).is_err_and(|why| why.contains("attributes")));
        let spaces = (0..100_000).map(|i| format!("<a xmlns:n{i}=\"u{i}\">")).collect::<Vec<_>>().concat();
        assert!(parsed(&spaces).is_err_and(|why| why.contains("spaces of names")));
        assert!(parsed(&format!("<a>{}</a>", "<b/>".repeat(2 * MAX_VALUES))).is_err());
        assert_eq!(document(&format!("<log{attributes}/>")), None);
    }

    #[test]
    fn what_describes_a_robot_or_is_nested_without_end_is_no_recording() {
        assert_eq!(document("<robot><link/><joint><origin xyz=\"0 0 1\" rpy=\"0 0 0\"/></joint></robot>"), None);
        assert_eq!(document("not XML"), None);
        assert_eq!(document(&format!("{}{}", "<a>".repeat(60), "</a>".repeat(60))), None);
    }
}
