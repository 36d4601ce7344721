/** One term of the selected material: model, colour, parameters, and its curves; the open curve unfolds in place. */
import { CurveEditor } from "../curve/CurveEditor";
import type { ModelInfo, Rgb, Term } from "../protocol";
import { edit } from "../state/edit";
import { pointer } from "../state/pointer";
import { defaultLook, models, modelOf, selectedCurve, selectedTerm } from "../state/store";
import { IconButton } from "../ui/Button";
import { ColorField } from "./ColorField";
import { ParamRow } from "./ParamRow";
import { withModel } from "./terms";

interface Props {
  material: string;
  term: Term;
  index: number;
  onRemove: (() => void) | null;
}

function Curves({ model, term, index }: { model: ModelInfo; term: Term; index: number }) {
  const open = selectedTerm.value === index ? selectedCurve.value : null;
  const info = model.curves.find((curve) => curve.name === open);
  return (
    <>
      <div class="curve-tabs" role="group" aria-label="Curves">
        {model.curves.map((curve) => (
          <button
            key={curve.name}
            aria-expanded={curve.name === open}
            onClick={() => {
              selectedTerm.value = index;
              selectedCurve.value = curve.name === open ? null : curve.name;
            }}
          >
            {curve.label}
            {term.curves?.[curve.name] !== undefined && <span class="dot" title="Drawn by hand" aria-label="drawn by hand" />}
          </button>
        ))}
      </div>
      {info !== undefined && <CurveEditor info={info} term={term} />}
    </>
  );
}

export function TermCard({ material, term, index, onRemove }: Props) {
  const model = modelOf(term);
  const path = pointer("materials", material, "terms", index);
  const initial = defaultLook.value?.materials[material]?.terms[index];
  const same = initial?.model === term.model ? initial : undefined;
  return (
    <section class="card" aria-label={`Term ${index + 1}: ${model?.label ?? term.model}`}>
      <header>
        <select
          aria-label="Model"
          title={model?.help}
          value={term.model}
          onChange={(event) => {
            selectedCurve.value = null;
            edit("Change model", path, withModel(term, event.currentTarget.value, models.value));
          }}
        >
          {models.value.map((m) => (
            <option key={m.model} value={m.model}>
              {m.label}
            </option>
          ))}
        </select>
        {onRemove !== null && <IconButton icon="trash" label="Remove this term" onClick={onRemove} />}
      </header>
      <ColorField
        label="Colour"
        value={term.color}
        initial={same?.color ?? null}
        onChange={(value: Rgb) => edit("Colour", `${path}/color`, value)}
      />
      {model?.parameters.map((info) => (
        <ParamRow
          key={info.name}
          info={info}
          value={term.params?.[info.name] ?? info.default}
          initial={same?.params?.[info.name] ?? info.default}
          onChange={(value) => edit(info.label, `${path}/params/${info.name}`, value)}
        />
      ))}
      {model !== undefined && <Curves model={model} term={term} index={index} />}
    </section>
  );
}
