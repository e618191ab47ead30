//! Commands of a plan file: the user's program, its arguments and limits.

use std::collections::BTreeMap;
use std::path::Path;

use campaign::{Call, Keep, LostRuns, TryLater};

use super::input_files::input_files;
use super::template::{self, TemplateError};
use crate::error::{InputError, Mistake, nearest};
use crate::input::toml_fields::Fields;

/// Time limit of a run [s], unless the plan has one.
const TIMEOUT_S: f64 = 3600.0;
/// Number of retries of a lost run, unless the plan has one.
const RETRIES: u32 = 2;

/// Reads the command of an experiment; `folder` is that of the plan. That of a worker has no placeholder but the folder.
pub(super) fn command(
    folder: &Path,
    fields: &Fields<'_>,
    (parameters, worker): (&[String], bool),
) -> Result<Call, InputError> {
    let argv = fields.texts("argv")?.ok_or_else(|| {
        fields
            .missing("argv")
            .expected("the program and its arguments")
            .help("argv = [\"sh\", \"{plan_dir}/simulate.sh\", \"{stiffness}\"]")
    })?;
    let files = input_files(folder, fields, parameters)?;
    let environment_table = fields.table("environment")?;
    let timeout_s = fields.positive("timeout_s", "s")?.map_or(TIMEOUT_S, |at| at.value);
    let retries = fields.whole("retries", 0, 100)?.map_or(RETRIES, |at| at.value as u32);
    let keep = fields
        .choice("keep", &[("failed", Keep::Failed), ("all", Keep::All), ("none", Keep::None)])?
        .map_or(Keep::Failed, |at| at.value);
    let lost = fields
        .choice("lost", &[("stop", LostRuns::Stop), ("fail", LostRuns::Fail)])?
        .map_or(LostRuns::Stop, |at| at.value);
    let try_later =
        fields.table("try_later")?.as_ref().map_or(Ok(TryLater::default()), try_later)?;
    fields.finish()?;
    let Some(program) = argv.value.first() else {
        return Err(fields
            .error("argv", argv.line, Mistake::Empty)
            .found("[]")
            .expected("the program and its arguments"));
    };
    let check = |text: &str, place: InputError| match template::check(text, parameters) {
        Ok(()) if worker => of_worker(text, place),
        Ok(()) => Ok(()),
        Err(error) => Err(template_error(place, text, &error, parameters)),
    };
    for argument in &argv.value {
        check(argument, fields.error("argv", argv.line, Mistake::UnknownName))?;
    }
    check_program(folder, fields, program, argv.line)?;
    let mut environment = BTreeMap::new();
    if let Some(table) = &environment_table {
        for (at, value) in table.named_texts()? {
            check(value, table.error(at.value, at.line, Mistake::UnknownName))?;
            if at.value.is_empty() || at.value.contains(['=', '\0']) || value.contains('\0') {
                return Err(table
                    .error(at.value, at.line, Mistake::OutOfRange)
                    .found("a name or value that no environment can hold"));
            }
            environment.insert(at.value.to_owned(), value.to_owned());
        }
    }
    Ok(Call {
        argv: argv.value.into_iter().map(str::to_owned).collect(),
        worker,
        files,
        environment,
        timeout_s,
        retries,
        try_later,
        lost,
        keep,
    })
}

/// Refuses placeholders of one run, of which a worker makes many.
fn of_worker(text: &str, place: InputError) -> Result<(), InputError> {
    match template::names(text).into_iter().find(|name| *name != "plan_dir") {
        None => Ok(()),
        Some(name) => Err(place
            .found(format_args!("the placeholder {{{name}}} of a worker"))
            .expected("{plan_dir} alone")
            .help("a worker is told parameters, seed and number of the run with every request")),
    }
}

/// The exit codes that ask to be called again later.
fn try_later(fields: &Fields<'_>) -> Result<TryLater, InputError> {
    let read: TryLater = fields.rest(&[])?;
    read.check().map_err(|error| {
        let line = fields.line_of(&error.field).or(fields.line()).unwrap_or(1);
        fields.error(&error.field, line, Mistake::OutOfRange).found(error.problem)
    })?;
    Ok(read)
}

/// A program with a folder in its name must be there; one without is looked for on the path.
fn check_program(
    folder: &Path,
    fields: &Fields<'_>,
    program: &str,
    line: usize,
) -> Result<(), InputError> {
    let refused = |found: String| fields.error("argv", line, Mistake::MissingFile).found(found);
    if program.contains('{') && !program.starts_with("{plan_dir}/") {
        return Ok(());
    }
    let beside_plan = program.strip_prefix("{plan_dir}/");
    let relative = beside_plan.unwrap_or(program);
    if beside_plan.is_some() || relative.contains('/') {
        let path = folder.join(relative);
        if !path.is_file() {
            return Err(refused(format!("the program {}", path.display()))
                .expected("a file that is there")
                .help("a name with a folder begins at the folder of the plan"));
        }
        return Ok(());
    }
    let found = std::env::var_os("PATH").is_some_and(|path| {
        std::env::split_paths(&path).any(|folder| folder.join(relative).is_file())
    });
    if found {
        return Ok(());
    }
    let beside = folder.join(relative).is_file();
    Err(refused(format!("the program \"{program}\", which is not on the path"))
        .help_if(beside.then(|| format!("it is beside the plan: write {{plan_dir}}/{program}")))
        .help("install it, or name it with its folder"))
}

fn template_error(
    base: InputError,
    template: &str,
    error: &TemplateError,
    parameters: &[String],
) -> InputError {
    match error {
        TemplateError::Unbalanced => base
            .found(format_args!("\"{template}\""))
            .expected("braces in pairs, around the name of a placeholder")
            .help("a brace of the command itself is written twice: {{ and }}"),
        TemplateError::Unknown(name) => {
            let known = parameters.iter().map(String::as_str).chain(template::RESERVED);
            base.found(format_args!("the placeholder {{{name}}}"))
                .expected(format_args!(
                    "one of {}, {}",
                    parameters.join(", "),
                    template::RESERVED.join(", ")
                ))
                .help_if(nearest(name, known).map(|near| format!("did you mean {{{near}}}?")))
                .help("a brace of the command itself is written twice: {{ and }}")
        }
    }
}
