/** Fit of a term in the Zernike basis that free-camera views use: number of functions, and residual. */
import { jsonPointer } from "../../state/document/pointer";
import { editValue } from "../../edit/edit";
import { history } from "../../edit/history";
import { BASIS_FUNCTIONS } from "../../look.gen";
import { getZernikeFit } from "../../session/net/api";
import type { MaterialLook, ZernikeFitBody, ZernikeFitRequest, Term } from "../../protocol";
import { look } from "../../state/look";
import { materialOf } from "../../state/scene";
import { selectedTerms } from "../../state/selection";
import { hasFreeCamera } from "../../state/views";
import { isBtfTerm } from "../../state/look";
import { isClientRendering } from "../../session/clientRendering";
import { useServerQuery } from "./useServerQuery";

/** What free cameras draw of a term while they move. */
export function fitMessage(fit: ZernikeFitBody, isClient: boolean): string {
  const { functions, available, residual, required_functions, drawn_by } = fit;
  const while_moving = "While the camera moves:";
  if (drawn_by === "rays")
    return isClient
      ? `${while_moving} this browser reflects the environment, blurred, and no objects.`
      : `${while_moving} reflections are ray traced.`;
  const percent = residual < 0.01 ? "less than 1 %" : `${Math.round(100 * residual)} %`;
  const count = `${functions} of ${available} basis functions, error ${percent}`;
  if (drawn_by === "lights")
    return `${while_moving} the environment’s highlight is exact to its visible lights; other light takes ${count}.`;
  const needed =
    residual <= 0.05
      ? ""
      : required_functions === null
        ? "; none of the numbers reaches 5 %"
        : `; under 5 % needs ${required_functions}`;
  return `${while_moving} ${count}${needed}.`;
}

/** Note about the tri-planar mapping of a material; null without. */
export const coverText = (material: string): string | null =>
  materialOf(material)?.is_projected === true
    ? "The object has no UVs: the texture is projected along the world axes (tri-planar, 1 m per repeat)."
    : null;

const fetchFits = (query: string) => getZernikeFit(JSON.parse(query) as ZernikeFitRequest);

/** The term of a material at `index`, as a free camera draws it; it depends on the other terms. */
export function ZernikeFit({ term, index, material }: { term: Term; index: number; material: string }) {
  const isCover = isBtfTerm(term);
  const basis_functions = look.value?.materials[material]?.basis_functions ?? null;
  const body: ZernikeFitRequest = { terms: selectedTerms.value, basis_functions };
  const fits = useServerQuery(hasFreeCamera.value && !isCover ? JSON.stringify(body) : null, fetchFits);
  if (isCover) {
    const cover = coverText(material);
    return cover === null ? null : <p class="in-motion">{cover}</p>;
  }
  const fit = fits?.[index];
  if (fit === undefined) return null;
  return (
    <p class="in-motion" title="Cosine-weighted RMS error of the in-out factorization. Exact when the camera stops.">
      {fitMessage(fit, isClientRendering.value)}
    </p>
  );
}

/** The number of basis functions of a material: automatic, or one to compare. */
export function BasisFunctions({ material, materialLook }: { material: string; materialLook: MaterialLook }) {
  if (!hasFreeCamera.value) return null;
  return (
    <label class="basis-functions">
      Basis functions
      <select
        title="Functions of the in-out factorization while the camera moves. A number draws their sum alone, without separate highlights, to compare."
        value={String(materialLook.basis_functions ?? "")}
        onChange={({ currentTarget: { value } }) => {
          history.endGesture();
          const functions = value === "" ? undefined : Number(value);
          editValue("Basis functions", jsonPointer("materials", material, "basis_functions"), functions);
        }}
      >
        <option value="">Automatic</option>
        {BASIS_FUNCTIONS.map((count) => (
          <option key={count} value={String(count)}>
            {count}
          </option>
        ))}
      </select>
    </label>
  );
}
