BEGIN TRANSACTION;
CREATE TABLE bakes (
	id VARCHAR NOT NULL, 
	scene_id VARCHAR NOT NULL, 
	recipe TEXT NOT NULL, 
	"plan" TEXT NOT NULL, 
	state VARCHAR NOT NULL, 
	created DOUBLE NOT NULL, 
	queued DOUBLE NOT NULL, 
	progress DOUBLE NOT NULL, 
	phase VARCHAR, 
	phase_since DOUBLE, 
	crowding DOUBLE, 
	code VARCHAR, 
	rays_per_second DOUBLE, 
	seconds_left DOUBLE, 
	bytes INTEGER NOT NULL, 
	problem TEXT, 
	owner VARCHAR, 
	heartbeat DOUBLE NOT NULL, 
	PRIMARY KEY (id), 
	FOREIGN KEY(scene_id) REFERENCES scenes (id)
);
INSERT INTO "bakes" VALUES('ba7b5972b1e3a23e','ffdaf26f076344ba','{"cameras":[],"method":"fake","num_lights":24,"num_points":50000,"relightable":false,"size":[16,32],"views":["front","left"]}','{"num_view_samples": 1044, "num_rays": 1000, "store_bytes": 1000, "peak_bytes": 1000}','ready',1.79556657358944797521e+09,1.79556657358944797521e+09,1.0,NULL,1.7955665746957108974e+09,4.302001953125,'97b35ecf05868aca',1.04729311337900549009e+03,NULL,41233,NULL,NULL,1.79556657469580245017e+09);
CREATE TABLE btfs (
	id VARCHAR NOT NULL, 
	request TEXT NOT NULL, 
	state VARCHAR NOT NULL, 
	done INTEGER NOT NULL, 
	problem TEXT, 
	created DOUBLE NOT NULL, 
	client VARCHAR, 
	is_first BOOLEAN, 
	PRIMARY KEY (id)
);
INSERT INTO "btfs" VALUES('bbbbbbbbbbbbbbbb','{}','failed',0,'for want of images',1.79556657339261341093e+09,NULL,NULL);
CREATE TABLE cameras (
	scene_id VARCHAR NOT NULL, 
	name VARCHAR NOT NULL, 
	document TEXT NOT NULL, 
	PRIMARY KEY (scene_id, name), 
	FOREIGN KEY(scene_id) REFERENCES scenes (id)
);
INSERT INTO "cameras" VALUES('ffdaf26f076344ba','kept','{"name": "kept", "to_world": [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 3.0, 0.0, 0.0, 0.0, 1.0], "yfov": 40.0}');
CREATE TABLE looks (
	name VARCHAR NOT NULL, 
	document TEXT NOT NULL, 
	etag VARCHAR NOT NULL, 
	modified DOUBLE NOT NULL, 
	PRIMARY KEY (name)
);
INSERT INTO "looks" VALUES('red','{"materials":{}}','"79982b7183259a79a2c3245aa9851fba"',1.79556657338183379177e+09);
CREATE TABLE renders (
	id VARCHAR NOT NULL, 
	request TEXT NOT NULL, 
	state VARCHAR NOT NULL, 
	done INTEGER NOT NULL, 
	problem TEXT, 
	created DOUBLE NOT NULL, 
	client VARCHAR, 
	is_first BOOLEAN, 
	PRIMARY KEY (id)
);
INSERT INTO "renders" VALUES('rrrrrrrrrrrrrrrr','{}','ready',3,NULL,1.7955665733925545215e+09,'c',1);
CREATE TABLE scenes (
	id VARCHAR NOT NULL, 
	name VARCHAR NOT NULL, 
	created DOUBLE NOT NULL, 
	summary TEXT NOT NULL, 
	PRIMARY KEY (id)
);
INSERT INTO "scenes" VALUES('ffdaf26f076344ba','triangle',1.7955665733559091091e+09,'{"views": ["front", "left"], "materials": [{"name": "Paper", "terms": [{"model": "lambert", "color": [0.5, 0.5, 0.5]}], "catcher": false, "is_projected": true, "is_glass": false}], "warnings": [], "num_triangles": 1, "variants": {}, "lights": []}');
CREATE TABLE shares (
	id VARCHAR NOT NULL, 
	document TEXT NOT NULL, 
	bytes INTEGER NOT NULL, 
	created DOUBLE NOT NULL, 
	PRIMARY KEY (id)
);
INSERT INTO "shares" VALUES('0123456789','{"bake":"x"}',12,1.79556657339242172234e+09);
CREATE TABLE tasks (
	bake_id VARCHAR NOT NULL, 
	stage INTEGER NOT NULL, 
	task_index INTEGER NOT NULL, 
	attempts INTEGER NOT NULL, 
	rays INTEGER NOT NULL, 
	trace_s DOUBLE NOT NULL, 
	seconds DOUBLE NOT NULL, 
	PRIMARY KEY (bake_id, stage, task_index), 
	FOREIGN KEY(bake_id) REFERENCES bakes (id)
);
INSERT INTO "tasks" VALUES('ba7b5972b1e3a23e',0,0,1,10,0.0,5.90047450004931306466e-02);
INSERT INTO "tasks" VALUES('ba7b5972b1e3a23e',0,1,1,10,0.0,1.79486890010593924671e-02);
INSERT INTO "tasks" VALUES('ba7b5972b1e3a23e',1,0,1,55,0.0,3.72461189999739872291e-02);
INSERT INTO "tasks" VALUES('ba7b5972b1e3a23e',1,1,1,55,0.0,3.27152390000264858826e-02);
INSERT INTO "tasks" VALUES('ba7b5972b1e3a23e',1,2,1,55,0.0,2.59023689995956374332e-02);
INSERT INTO "tasks" VALUES('ba7b5972b1e3a23e',1,3,1,55,0.0,2.2632084001088514924e-02);
INSERT INTO "tasks" VALUES('ba7b5972b1e3a23e',1,4,1,55,0.0,1.71411250012170057743e-02);
INSERT INTO "tasks" VALUES('ba7b5972b1e3a23e',1,5,1,55,0.0,1.70534999997471459209e-02);
INSERT INTO "tasks" VALUES('ba7b5972b1e3a23e',1,6,1,55,0.0,1.71215579994168365374e-02);
INSERT INTO "tasks" VALUES('ba7b5972b1e3a23e',1,7,1,55,0.0,1.61360589991090819239e-02);
INSERT INTO "tasks" VALUES('ba7b5972b1e3a23e',1,8,1,55,0.0,2.3748448998958338052e-02);
INSERT INTO "tasks" VALUES('ba7b5972b1e3a23e',1,9,1,55,0.0,1.69053629997506504878e-02);
INSERT INTO "tasks" VALUES('ba7b5972b1e3a23e',1,10,1,55,0.0,1.56992590000299969688e-02);
INSERT INTO "tasks" VALUES('ba7b5972b1e3a23e',1,11,1,55,0.0,5.91825179999432293698e-02);
INSERT INTO "tasks" VALUES('ba7b5972b1e3a23e',1,12,1,55,0.0,6.43213980001746676862e-02);
INSERT INTO "tasks" VALUES('ba7b5972b1e3a23e',1,13,1,55,0.0,1.41558583998630638234e-01);
INSERT INTO "tasks" VALUES('ba7b5972b1e3a23e',1,14,1,55,0.0,1.86848721999922418035e-01);
INSERT INTO "tasks" VALUES('ba7b5972b1e3a23e',1,15,1,55,0.0,0.0416868690008414);
INSERT INTO "tasks" VALUES('ba7b5972b1e3a23e',1,16,1,55,0.0,4.00882600006298162043e-02);
INSERT INTO "tasks" VALUES('ba7b5972b1e3a23e',1,17,1,55,0.0,7.73343490000115707516e-02);
CREATE TABLE truths (
	id VARCHAR NOT NULL, 
	request TEXT NOT NULL, 
	state VARCHAR NOT NULL, 
	done INTEGER NOT NULL, 
	problem TEXT, 
	created DOUBLE NOT NULL, 
	client VARCHAR, 
	is_first BOOLEAN, 
	PRIMARY KEY (id)
);
INSERT INTO "truths" VALUES('tttttttttttttttt','{}','queued',1,NULL,1.79556657339271140104e+09,'c',0);
CREATE INDEX ix_renders_state ON renders (state);
CREATE INDEX ix_btfs_state ON btfs (state);
CREATE INDEX ix_truths_state ON truths (state);
CREATE INDEX ix_bakes_state ON bakes (state);
CREATE INDEX ix_bakes_scene_id ON bakes (scene_id);
CREATE INDEX tasks_of_bake ON tasks (bake_id);
COMMIT;
