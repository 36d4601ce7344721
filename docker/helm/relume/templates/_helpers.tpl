{{- define "relume.name" -}}{{ .Release.Name | trunc 40 | trimSuffix "-" }}{{- end }}

{{- define "relume.labels" -}}
app.kubernetes.io/name: relume
app.kubernetes.io/instance: {{ .Release.Name }}
{{- end }}

{{- define "relume.image" -}}{{ .Values.image.repository }}:{{ .Values.image.tag | default .Chart.AppVersion }}{{- end }}

{{- define "relume.podSecurity" -}}
runAsNonRoot: true
runAsUser: 10001
runAsGroup: 10001
fsGroup: 10001
fsGroupChangePolicy: OnRootMismatch
seccompProfile: {type: RuntimeDefault}
{{- end }}

{{- define "relume.containerSecurity" -}}
allowPrivilegeEscalation: false
readOnlyRootFilesystem: true
capabilities: {drop: [ALL]}
{{- end }}

{{- define "relume.claim" -}}{{ .Values.data.existingClaim | default (printf "%s-data" (include "relume.name" .)) }}{{- end }}

{{- /* What servers and workers are told alike. */ -}}
{{- define "relume.environment" -}}
- name: RELUME_DATA
  value: /data
- name: RELUME_DATABASE
  valueFrom:
    secretKeyRef:
      name: {{ required "database.secretName: name the secret with the database's URL" .Values.database.secretName }}
      key: {{ .Values.database.secretKey }}
- name: RELUME_LOG_FORMAT
  value: json
- name: RELUME_LOG_LEVEL
  value: info
{{- with .Values.storage }}
{{- if .url }}
- name: RELUME_STORAGE
  value: {{ .url | quote }}
{{- if .endpoint }}
- name: AWS_ENDPOINT_URL
  value: {{ .endpoint | quote }}
{{- end }}
{{- if .region }}
- name: AWS_REGION
  value: {{ .region | quote }}
{{- end }}
{{- if .secretName }}
{{- range $key := list "AWS_ACCESS_KEY_ID" "AWS_SECRET_ACCESS_KEY" }}
- name: {{ $key }}
  valueFrom:
    secretKeyRef:
      name: {{ $.Values.storage.secretName }}
      key: {{ $key }}
{{- end }}
{{- end }}
{{- end }}
{{- end }}
{{- end }}
