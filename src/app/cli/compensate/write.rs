use std::io::Write;

use super::{CompensateArgs, CompensateCommandError, Result, WriteCause};
use crate::files::table::{self, Table};
use crate::files::whole_file::write_whole;
use crate::io::targets::{self, Form, JointUnits};

impl CompensateArgs {
    /// The form of the result, known before anything is read.
    pub(super) fn out_form(&self) -> Result<Form> {
        self.check_folders()?;
        let form = Form::of(&self.targets)?;
        let Some(out) = &self.out else {
            return Ok(if form == Form::Json { form } else { Form::Csv });
        };
        let wanted = Form::of(out)?;
        if out.exists() { Err(CompensateCommandError::Exists(out.clone())) } else { Ok(wanted) }
    }

    pub(super) fn write(&self, bytes: &[u8], mut stdout: impl Write) -> Result<()> {
        let written = match &self.out {
            None => stdout.write_all(bytes).and_then(|()| stdout.flush()),
            Some(out) => write_whole(out, |sink| sink.write_all(bytes)),
        };
        written.map_err(|source| self.not_written(source.into()))
    }

    pub(super) fn not_written(&self, source: WriteCause) -> CompensateCommandError {
        let path = self.out.clone();
        CompensateCommandError::Write { path, source }
    }
}

pub(super) fn bytes(result: &Table, form: Form, units: JointUnits) -> Result<Vec<u8>, WriteCause> {
    let mut bytes = Vec::new();
    match form {
        Form::Csv => targets::write_csv(result, units, &mut bytes)?,
        Form::Json => targets::write_json(result, units, &mut bytes)?,
        Form::Parquet => bytes = table::write(result, bytes)?,
    }
    Ok(bytes)
}
