//! From the text of a file to its links and joints, and whether they are a tree.

use std::collections::{BTreeMap, BTreeSet};

use roxmltree::{Document, Node};

use super::{RawJoint, RawLimit, RawOrigin, Urdf, UrdfError, UrdfProblem};

pub(super) fn read(text: &str, file: &str) -> Result<Urdf, UrdfError> {
    let fail = |line: Option<u32>, problem| UrdfError { file: file.to_owned(), line, problem: Box::new(problem) };
    let document = Document::parse(text).map_err(|error| {
        // The prefix need not be declared in a part of a robot that another file includes.
        if text.contains("<xacro:") {
            return fail(None, UrdfProblem::Xacro);
        }
        // A missing end is reported at the very beginning.
        let (row, column) = (error.pos().row, error.pos().col);
        fail((row, column).ne(&(1, 1)).then_some(row), UrdfProblem::NotXml(error.to_string()))
    })?;
    let line = |node: &Node<'_, '_>| Some(document.text_pos_at(node.range().start).row);
    // xacro leaves its namespace on the root of its output, so only an element or an unexpanded text identifies a
    // source.
    let xacro = document.descendants().find(|node| {
        node.tag_name().namespace().is_some_and(|space| space.contains("xacro"))
            || node.attributes().any(|a| a.value().contains("${") || a.value().contains("$(arg "))
    });
    if let Some(node) = xacro {
        return Err(fail(line(&node), UrdfProblem::Xacro));
    }
    let root = document.root_element();
    if root.tag_name().name() != "robot" {
        return Err(fail(line(&root), UrdfProblem::NotUrdf { root: root.tag_name().name().to_owned() }));
    }
    let mut links = Vec::new();
    let mut joints: Vec<RawJoint> = Vec::new();
    let mut names = BTreeSet::new();
    // A <joint> of a <transmission> or a <gazebo> is a reference, not a joint.
    for node in root.children().filter(Node::is_element) {
        let kind = node.tag_name().name();
        if kind != "link" && kind != "joint" {
            continue;
        }
        let Some(name) = node.attribute("name") else {
            return Err(fail(line(&node), UrdfProblem::Missing { element: format!("a <{kind}>"), what: "name" }));
        };
        let element = format!("{kind} \"{name}\"");
        if !names.insert((kind == "link", name)) {
            return Err(fail(line(&node), UrdfProblem::Twice { element }));
        }
        if kind == "link" {
            links.push(name.to_owned());
        } else {
            let joint = joint(&node, name, line(&node).unwrap_or_default())
                .map_err(|what| fail(line(&node), UrdfProblem::Missing { element, what }))?;
            joints.push(joint);
        }
    }
    if links.is_empty() {
        let problem = UrdfProblem::Missing { element: "<robot>".to_owned(), what: "<link>: describe the arm in it" };
        return Err(fail(line(&root), problem));
    }
    let urdf = Urdf { file: file.to_owned(), version: version(&root), links, joints };
    check_tree(&urdf)?;
    Ok(urdf)
}

/// The `version` of the robot; 1.0 where it states none or something else, as in other readers.
fn version(root: &Node<'_, '_>) -> (u32, u32) {
    let text = root.attribute("version").unwrap_or_default().trim();
    let parts = text.split_once('.').and_then(|(a, b)| Some((a.parse().ok()?, b.parse().ok()?)));
    parts.unwrap_or((1, 0))
}

/// One joint, or what it lacks.
fn joint(node: &Node<'_, '_>, name: &str, line: u32) -> Result<RawJoint, &'static str> {
    let child = |tag: &str| node.children().find(|child| child.is_element() && child.tag_name().name() == tag);
    let text = |element: &Node<'_, '_>, attribute: &str| element.attribute(attribute).map(str::to_owned);
    let link = |tag: &str| child(tag).and_then(|end| text(&end, "link"));
    Ok(RawJoint {
        name: name.to_owned(),
        line,
        kind: text(node, "type").ok_or("type: revolute, continuous, prismatic or fixed")?,
        parent: link("parent").ok_or("<parent link=\"…\">")?,
        child: link("child").ok_or("<child link=\"…\">")?,
        origin: child("origin").map(|origin| RawOrigin {
            xyz: text(&origin, "xyz"),
            rpy: text(&origin, "rpy"),
            quat_xyzw: text(&origin, "quat_xyzw"),
        }),
        axis: match child("axis") {
            None => None,
            Some(axis) => Some(text(&axis, "xyz").ok_or("xyz in its <axis>")?),
        },
        limit: child("limit").map(|limit| RawLimit {
            lower: text(&limit, "lower"),
            upper: text(&limit, "upper"),
            velocity: text(&limit, "velocity"),
        }),
        mimic: child("mimic").map(|mimic| text(&mimic, "joint").unwrap_or_default()),
    })
}

/// Checks that every joint is between existing links, that no link is behind two joints, and that there is no loop.
fn check_tree(urdf: &Urdf) -> Result<(), UrdfError> {
    let links: BTreeSet<&str> = urdf.links.iter().map(String::as_str).collect();
    let mut carried_by: BTreeMap<&str, &RawJoint> = BTreeMap::new();
    for joint in &urdf.joints {
        for (end, link) in [("parent", &joint.parent), ("child", &joint.child)] {
            if !links.contains(link.as_str()) {
                let problem = UrdfProblem::UnknownLink { joint: joint.name.clone(), end, link: link.clone() };
                return Err(urdf.error(Some(joint), problem));
            }
        }
        if let Some(first) = carried_by.insert(&joint.child, joint) {
            let (link, first, second) = (joint.child.clone(), first.name.clone(), joint.name.clone());
            return Err(urdf.error(Some(joint), UrdfProblem::TwoParents { link, first, second }));
        }
    }
    // Links whose path upwards is known to end. Each link is passed once however long the chain.
    let mut rooted: BTreeSet<&str> = BTreeSet::new();
    for start in links {
        let (mut way, mut link) = (BTreeSet::new(), start);
        while let Some(joint) = carried_by.get(link).filter(|_| !rooted.contains(link)) {
            if !way.insert(link) {
                return Err(urdf.error(Some(joint), UrdfProblem::Loop { link: link.to_owned() }));
            }
            link = &joint.parent;
        }
        rooted.extend(way);
    }
    Ok(())
}
