/** A field for each import option. */
import { useId } from "preact/hooks";
import type { ImportOptions } from "../protocol";
import { IMPORT_OPTIONS, type ImportOption } from "./importOptions";

const MAX_TEXT = 200; // characters, the server's limit

interface ImportOptionsFormProps {
  options: ImportOptions;
  onChange: (options: ImportOptions) => void;
}

export function ImportOptionsForm({ options, onChange }: ImportOptionsFormProps) {
  const form = useId();
  const field = ({ key, choices }: ImportOption) => {
    const change = (event: { currentTarget: { value: string } }) => {
      const { value } = event.currentTarget;
      onChange({ ...options, [key]: key !== "time" ? value : value === "" ? null : Number(value) });
    };
    const [id, value] = [`${form}-${key}`, options[key] ?? ""];
    // another drawing of the dialog must not take back what is being typed
    const typed = { id, key: value, defaultValue: value, onChange: change };
    if (key === "time") return <input {...typed} type="number" step="any" placeholder="Rest pose" />;
    if (choices.length === 0) return <input {...typed} maxLength={MAX_TEXT} placeholder="As in file" />;
    return (
      <select id={id} value={value} onChange={change}>
        {choices.map(({ value, label }) => (
          <option key={value} value={value ?? ""}>
            {label}
          </option>
        ))}
      </select>
    );
  };
  return (
    <fieldset class="import-options">
      <legend>Import options</legend>
      {IMPORT_OPTIONS.map((option) => (
        <label key={option.key} for={`${form}-${option.key}`} title={option.help}>
          {option.label}
          {field(option)}
        </label>
      ))}
    </fieldset>
  );
}
