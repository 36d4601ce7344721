/** One term of the selected material: model, color, parameters and curves; the open curve expands in place. */
import { useMemo } from "preact/hooks";
import { toHex } from "../../render/color/colorMath";
import { CurveEditor } from "../../curve/CurveEditor";
import { jsonPointer } from "../../state/document/pointer";
import { editValue } from "../../edit/edit";
import { isImageReference } from "../../state/document/imageReference";
import { withTexture } from "./images/baseColor";
import { imageOf } from "./images/imageStore";
import { RoughnessImage } from "./images/RoughnessImage";
import { withMap } from "./images/roughness";
import { beginDrag } from "../../session/prepare";
import type { ModelBody, Rgb, Term } from "../../protocol";
import { defaultLook } from "../../state/look";
import { modelOf, models } from "../../state/scene";
import { selectedCurve, selectedTerm, selectTerm, selectedTerms } from "../../state/selection";
import { hasFreeCamera } from "../../state/views";
import { IconButton } from "../../ui/IconButton";
import { ColorField } from "../../ui/ColorField";
import { ZernikeFit } from "./ZernikeFit";
import { ParamRow } from "./ParamRow";
import { btfOf, getStoredQuality, limitToStored, isWithinStored } from "./measuredInfo";
import { hasRoughnessMap, modelsFor, TEXTURES, texturesOf, withModel } from "./terms";
import { useServerQuery } from "./useServerQuery";

interface Props {
  material: string;
  term: Term;
  index: number;
  onRemove: (() => void) | null;
}

/** The symbol of "half angle θh" is its last word. */
function termSymbol(label: string): string {
  return label.split(" ").at(-1) ?? label;
}

function TermCurves({ model, term, index }: { model: ModelBody; term: Term; index: number }) {
  const open = selectedTerm.value === index ? selectedCurve.value : null;
  const info = model.curves.find((curve) => curve.name === open);
  const edits = info && term.curves?.[info.name];
  // the same node for the same curve: a parameter change keeps the plot until the server sends the new shape
  const editor = useMemo(() => info && <CurveEditor info={info} edits={edits} />, [info, edits]);
  return (
    <>
      <div class="curve-tabs" role="group" aria-label="Curves">
        {model.curves.map((curve) => (
          <button
            key={curve.name}
            title={curve.label}
            aria-label={curve.label}
            aria-expanded={curve.name === open}
            onClick={() => {
              selectedTerm.value = index;
              selectedCurve.value = curve.name === open ? null : curve.name;
            }}
          >
            {curve.name === open ? curve.label : termSymbol(curve.label)}
            {term.curves?.[curve.name] !== undefined && <span class="dot" title="Edited" aria-label="edited" />}
          </button>
        ))}
      </div>
      {editor}
    </>
  );
}

interface TextureProps {
  /** The material's textures. */
  channels: readonly string[];
  value: string | null;
  onChange: (value: string | null) => void;
}

/** Chooses the texture that multiplies the color. */
function TextureRow({ channels, value, onChange }: TextureProps) {
  const image = isImageReference(value) ? value : null;
  if (channels.length === 0 && image === null) return null;
  return (
    <label class="param texture">
      <span class="param-label">Texture</span>
      <select
        value={image ?? channels.find((name) => name === value) ?? ""}
        onChange={(event) => onChange(event.currentTarget.value || null)}
      >
        <option value="">None</option>
        {image !== null && <option value={image}>{imageOf(image)?.name ?? "Texture"}</option>}
        {channels.map((name) => (
          <option key={name} value={name}>
            {TEXTURES[name]}
          </option>
        ))}
      </select>
    </label>
  );
}

/** How the term's roughness map, width slider and curves combine. */
function MapWidthRow({ term, model }: { term: Term; model: ModelBody }) {
  const width = model.width_parameter as string;
  if (model.curves.some((curve) => curve.parameters.includes(width) && term.curves?.[curve.name] !== undefined)) {
    return <p class="aside">Drawing a curve overrides the map.</p>;
  }
  const label = model.parameters.find((info) => info.name === width)?.label ?? width;
  return (
    <p class="aside">
      {`“${label}” multiplies the map; the curve shows its average`}
      {hasFreeCamera.value ? ", as does the view while the camera moves." : "."}
    </p>
  );
}

export function TermCard({ material, term, index, onRemove }: Props) {
  const model = modelOf(term);
  const path = jsonPointer("materials", material, "terms", index);
  const initial = defaultLook.value?.materials[material]?.terms[index];
  const same = initial?.model === term.model ? initial : undefined;
  const open = selectedTerm.value === index;
  const follows = term.roughness_map != null;
  const storedQuality = useServerQuery(open ? btfOf(term) : null, getStoredQuality);
  const changeModel = (name: string) => {
    editValue("Change model", path, withModel(term, name, models.value));
    selectTerm(index);
    selectedCurve.value = models.value.find((m) => m.model === name)?.curves[0]?.name ?? null;
  };
  return (
    <section class={`card ${open ? "" : "folded"}`} aria-label={`Layer ${index + 1}: ${model?.label ?? term.model}`}>
      <header>
        <button
          class="icon fold"
          aria-expanded={open}
          aria-label={open ? "Open layer" : "Expand"}
          onClick={() => selectTerm(index)}
        >
          {open ? "▾" : "▸"}
        </button>
        {!open && <span class="patch" style={{ background: toHex(term.color) }} />}
        <select
          aria-label="Model"
          title={model?.help}
          value={term.model}
          onChange={(event) => changeModel(event.currentTarget.value)}
        >
          {modelsFor(term, models.value).map((m) => (
            <option key={m.model} value={m.model}>
              {m.label}
            </option>
          ))}
        </select>
        {onRemove !== null && <IconButton icon="trash" label="Remove layer" onClick={onRemove} />}
      </header>
      {open && (
        <>
          <ColorField
            label="Color"
            value={term.color}
            initial={same?.color ?? null}
            onChange={(value: Rgb) => editValue("Color", `${path}/color`, value)}
          />
          <TextureRow
            channels={texturesOf(material)}
            value={term.texture ?? null}
            onChange={(value) =>
              editValue(
                "Texture",
                jsonPointer("materials", material, "terms"),
                withTexture(selectedTerms.value, index, value),
              )
            }
          />
          {model?.width_parameter != null && (
            <RoughnessImage
              material={material}
              index={index}
              value={term.roughness_map ?? null}
              hasOwn={hasRoughnessMap(material)}
              onChange={(value) =>
                editValue(
                  "Roughness map",
                  jsonPointer("materials", material, "terms"),
                  withMap(selectedTerms.value, index, value),
                )
              }
            />
          )}
          {model?.width_parameter != null && follows && <MapWidthRow term={term} model={model} />}
          {model?.parameters
            .map((declared) => limitToStored(declared, storedQuality))
            .map((info) => (
              <ParamRow
                key={info.name}
                info={info}
                value={isWithinStored(info, term.params?.[info.name])}
                initial={same?.params?.[info.name] ?? info.default}
                onChange={(value) => editValue(info.label, `${path}/params/${info.name}`, value)}
                onHold={() => beginDrag(`${path}/params/${info.name}`)}
              />
            ))}
          {model !== undefined && <TermCurves model={model} term={term} index={index} />}
          <ZernikeFit term={term} index={index} material={material} />
        </>
      )}
    </section>
  );
}
