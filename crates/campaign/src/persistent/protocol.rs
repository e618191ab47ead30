//! The lines that a driver and a worker exchange: docs/worker-protocol.md.

use std::path::Path;

use serde_json::{Map, Value, json};

use crate::folder::ANSWER;
use crate::spec::{CampaignSpec, CommandSpec, OutputSpec};
use crate::table;
use crate::task::Task;

/// The version of the protocol that this program speaks.
const VERSION: u64 = 1;

/// What a worker says to a request.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Answer {
    /// Columns of values, by name.
    Values(Value),
    /// The run failed, or is to be asked for again later.
    Failure {
        /// As the exit code of a command, 1 to 255.
        code: i32,
        /// As the stderr of a command.
        message: String,
    },
}

/// The first line to a worker.
pub(super) fn hello(spec: &CampaignSpec, command: &CommandSpec) -> Vec<u8> {
    let answered = command.outputs.iter().filter(|output| output.result.file == ANSWER);
    let output = |output: &OutputSpec| {
        let result = &output.result;
        json!({"value": result.value, "control": result.control, "at": output.at})
    };
    line(&json!({
        "protocol": VERSION,
        "experiment": command.name,
        "parameters": spec.parameter_names,
        "outputs": answered.map(output).collect::<Vec<_>>(),
    }))
}

/// Checks the first line of a worker; the error says what is wrong with it.
pub(super) fn check_hello(line: &[u8]) -> Result<(), String> {
    let expected = || format!("{{\"protocol\": {VERSION}}}");
    match read(line).ok().and_then(|hello| hello.get("protocol").cloned()) {
        Some(version) if version == VERSION => Ok(()),
        Some(version) => {
            Err(format!("it speaks version {version} of the protocol, this program {VERSION}"))
        }
        None => Err(format!(
            "its first line is not {} but {:?}; what is no answer belongs on stderr",
            expected(),
            beginning(line)
        )),
    }
}

/// A request.
pub(super) fn request(id: u64, spec: &CampaignSpec, task: &Task, folder: &Path) -> Vec<u8> {
    let names = spec.parameter_names.iter().cloned();
    let values = task.parameters.iter().map(|&value| Value::from(value));
    line(&json!({
        "id": id,
        "run": task.number,
        "seed": spec.seed_of(task.number),
        "parameters": names.zip(values).collect::<Map<_, _>>(),
        "folder": folder.to_string_lossy(),
    }))
}

/// Reads the answer to request `id`. The words of an error are the same for the same cause.
pub(super) fn answer(line: &[u8], id: u64) -> Result<Answer, &'static str> {
    let Value::Object(mut answer) = read(line)? else { return Err("not an object") };
    // R and others write whole numbers as 1.0.
    if answer.get("id").and_then(Value::as_f64) != Some(id as f64) {
        return Err("to another request");
    }
    match (answer.remove("values"), answer.remove("failure")) {
        (Some(values @ Value::Object(_)), None) => Ok(Answer::Values(values)),
        (Some(_), None) => Err("values that are not an object of columns"),
        (None, Some(failure)) => {
            let code = failure.get("code").and_then(Value::as_i64);
            let code = code.filter(|code| (1..=255).contains(code));
            let code = code.ok_or("a failure without a code of 1 to 255")? as i32;
            let message = failure.get("message").and_then(Value::as_str).unwrap_or_default();
            Ok(Answer::Failure { code, message: message.to_owned() })
        }
        _ => Err("not one of values and failure"),
    }
}

/// The start of a line, for a message.
pub(super) fn beginning(line: &[u8]) -> String {
    String::from_utf8_lossy(line).trim_end().chars().take(200).collect()
}

fn read(line: &[u8]) -> Result<Value, &'static str> {
    let text = std::str::from_utf8(line).map_err(|_| "not JSON")?;
    table::parse_json(text).map_err(|_| "not JSON")
}

fn line(message: &Value) -> Vec<u8> {
    format!("{message}\n").into_bytes()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_worker_of_the_same_version_is_accepted_and_another_is_named() {
        assert_eq!(check_hello(b"{\"protocol\": 1, \"name\": \"mine\"}\n"), Ok(()));
        let newer = check_hello(b"{\"protocol\": 2}\n").expect_err("another");
        assert!(newer.contains("version 2") && newer.contains("program 1"), "{newer}");
        for wrong in ["Loading ...\n", "", "1\n", "{}\n", "\u{0}\n"] {
            let said = check_hello(wrong.as_bytes()).expect_err(wrong);
            assert!(said.contains("{\"protocol\": 1}"), "{said}");
        }
    }

    #[test]
    fn numbers_of_a_request_read_back_as_the_same_bits() {
        let spec = CampaignSpec { parameter_names: vec!["a".into()], commands: vec![], seed: 3 };
        for value in [0.1, -0.0, 5e-324, 1.0 / 3.0, 1e300, 2.0] {
            let task = Task { number: 7, command: 0, parameters: vec![value] };
            let text = request(2, &spec, &task, Path::new("/tmp/a \"b\""));
            assert!(text.ends_with(b"}\n") && !text[..text.len() - 1].contains(&b'\n'));
            let read: Value = serde_json::from_slice(&text).expect("JSON");
            assert_eq!(read["parameters"]["a"].as_f64().map(f64::to_bits), Some(value.to_bits()));
            assert_eq!((&read["id"], &read["run"]), (&Value::from(2), &Value::from(7)));
            assert_eq!(read["seed"], spec.seed_of(7));
            assert_eq!(read["folder"], "/tmp/a \"b\"");
        }
    }

    #[test]
    fn an_answer_is_values_or_a_failure_to_this_request_and_nothing_else() {
        let values = answer(b"{\"id\": 4, \"values\": {\"y\": [0.1, NaN], \"z\": 3}}\n", 4);
        assert_eq!(values, Ok(Answer::Values(json!({"y": [0.1, null], "z": 3}))));
        let failure = answer(b"{\"id\": 4, \"failure\": {\"code\": 75, \"message\": \"no\"}}\n", 4);
        assert_eq!(failure, Ok(Answer::Failure { code: 75, message: "no".into() }));
        for (line, problem) in [
            ("{\"id\": 3, \"values\": {}}\n", "to another request"),
            ("{\"values\": {}}\n", "to another request"),
            ("hello\n", "not JSON"),
            ("\u{0}\n", "not JSON"),
            ("[4]\n", "not an object"),
            ("{\"id\": 4}\n", "not one of values and failure"),
            (
                "{\"id\": 4, \"values\": {}, \"failure\": {\"code\": 1}}\n",
                "not one of values and failure",
            ),
            ("{\"id\": 4, \"values\": [1]}\n", "values that are not an object of columns"),
            ("{\"id\": 4, \"failure\": \"no\"}\n", "a failure without a code of 1 to 255"),
            ("{\"id\": 4, \"failure\": {\"code\": 0}}\n", "a failure without a code of 1 to 255"),
            ("{\"id\": 4, \"failure\": {\"code\": 256}}\n", "a failure without a code of 1 to 255"),
        ] {
            assert_eq!(answer(line.as_bytes(), 4), Err(problem), "{line}");
        }
        assert_eq!(answer(b"\xff\n", 4), Err("not JSON"));
    }
}
