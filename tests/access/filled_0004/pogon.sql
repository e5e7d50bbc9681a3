BEGIN TRANSACTION;
CREATE TABLE alarm_event_mark (
	equipment VARCHAR(64) NOT NULL, 
	boot INTEGER NOT NULL, 
	sequence BIGINT NOT NULL, 
	time BIGINT NOT NULL, 
	CONSTRAINT pk_alarm_event_mark PRIMARY KEY (equipment)
);
CREATE TABLE alarm_journal (
	seq INTEGER NOT NULL, 
	time BIGINT NOT NULL, 
	first_true BIGINT NOT NULL, 
	event VARCHAR(16) NOT NULL, 
	detail VARCHAR(200) NOT NULL, 
	alarm VARCHAR(160) NOT NULL, 
	occurrence INTEGER NOT NULL, 
	equipment VARCHAR(64) NOT NULL, 
	area VARCHAR(64) NOT NULL, 
	alarm_class VARCHAR(32) NOT NULL, 
	priority INTEGER NOT NULL, 
	"before" VARCHAR(1) NOT NULL, 
	"after" VARCHAR(1) NOT NULL, 
	active BOOLEAN NOT NULL, 
	acked BOOLEAN NOT NULL, 
	latched BOOLEAN NOT NULL, 
	hidden VARCHAR(16) NOT NULL, 
	silent BOOLEAN NOT NULL, 
	ordinal INTEGER NOT NULL, 
	value FLOAT, 
	unit VARCHAR(16) NOT NULL, 
	quality VARCHAR(40) NOT NULL, 
	"limit" FLOAT, 
	person_id INTEGER NOT NULL, 
	person VARCHAR(64) NOT NULL, 
	roles VARCHAR(64) NOT NULL, 
	address VARCHAR(64) NOT NULL, 
	session VARCHAR(16) NOT NULL, 
	comment TEXT NOT NULL, 
	type VARCHAR(64) NOT NULL, 
	text_id VARCHAR(160) NOT NULL, 
	params TEXT NOT NULL, 
	text TEXT NOT NULL, 
	config VARCHAR(16) NOT NULL, 
	mac VARCHAR(64) NOT NULL, 
	CONSTRAINT pk_alarm_journal PRIMARY KEY (seq)
);
CREATE TABLE alarm_state (
	alarm VARCHAR(160) NOT NULL, 
	equipment VARCHAR(64) NOT NULL, 
	"key" VARCHAR(64) NOT NULL, 
	occurrence INTEGER NOT NULL, 
	active BOOLEAN NOT NULL, 
	acked BOOLEAN NOT NULL, 
	latched BOOLEAN NOT NULL, 
	shelved BOOLEAN NOT NULL, 
	suppressed BOOLEAN NOT NULL, 
	out_of_service BOOLEAN NOT NULL, 
	known BOOLEAN NOT NULL, 
	first_true BIGINT NOT NULL, 
	annunciated BIGINT NOT NULL, 
	returned BIGINT NOT NULL, 
	acked_at BIGINT NOT NULL, 
	acked_by VARCHAR(80) NOT NULL, 
	count INTEGER NOT NULL, 
	ordinal INTEGER NOT NULL, 
	uncertain BOOLEAN NOT NULL, 
	value FLOAT, 
	"limit" FLOAT, 
	params TEXT NOT NULL, 
	CONSTRAINT pk_alarm_state PRIMARY KEY (alarm)
);
CREATE TABLE alembic_version (
	version_num VARCHAR(32) NOT NULL, 
	CONSTRAINT alembic_version_pkc PRIMARY KEY (version_num)
);
INSERT INTO "alembic_version" VALUES('0004');
CREATE TABLE audit (
	seq INTEGER NOT NULL, 
	time BIGINT NOT NULL, 
	kind VARCHAR(64) NOT NULL, 
	person_id INTEGER NOT NULL, 
	person VARCHAR(64) NOT NULL, 
	address VARCHAR(64) NOT NULL, 
	session VARCHAR(16) NOT NULL, 
	object VARCHAR(120) NOT NULL, 
	old TEXT NOT NULL, 
	new TEXT NOT NULL, 
	result VARCHAR(32) NOT NULL, 
	reason TEXT NOT NULL, 
	params TEXT NOT NULL, 
	mac VARCHAR(64) NOT NULL, 
	CONSTRAINT pk_audit PRIMARY KEY (seq)
);
INSERT INTO "audit" VALUES(1,1773036300000000,'server.started',0,'system','','','','','','ok','','{"install":"","version":""}','84f9a60319b066766d5139582efd37e4efbf648899d5b8c8da07f762247f2659');
INSERT INTO "audit" VALUES(2,1773036300000000,'person.first',1,'ana','10.0.0.9','22c9be955eb…','ana','','admin, engineer, operator','ok','','{}','08ffd6f1530e7f8e66dbc9c7283bd05583eb8760b73f99b57242555729b579fa');
INSERT INTO "audit" VALUES(3,1773036300000000,'signin.ok',1,'ana','10.0.0.9','22c9be955eb…','ana','','','ok','','{"agent":"Mozilla/5.0 (X11; Linux x86_64) Firefox/140.0"}','9f480b079cc4933cf4c1edb4949978b2a0574e0adada0976076c2d3339d71c73');
INSERT INTO "audit" VALUES(4,1773036300000000,'person.added',1,'ana','10.0.0.9','22c9be955eb…','ivo','','operator','ok','','{"display":"Ivo"}','48f7f93f5ccd0b9e3e83ec784b232ae158feefb70ec4f3adfdfb148873fa011a');
INSERT INTO "audit" VALUES(5,1773036300000000,'password.set',1,'ana','10.0.0.9','22c9be955eb…','ivo','','','ok','','{}','3136a0b574357b2edcc09d9a9698b215bbb766462e68a9ace5d6ee312dd8569a');
INSERT INTO "audit" VALUES(6,1773036300000000,'person.added',1,'ana','10.0.0.9','22c9be955eb…','eve','','viewer','ok','','{"display":"eve"}','f94ca29b525fc3e848c68f53aa385dd7f6d4281f9f97fca961b44b3df280d210');
INSERT INTO "audit" VALUES(7,1773036300000000,'person.disabled',1,'ana','10.0.0.9','22c9be955eb…','eve','','','ok','','{}','7c6370b6d28928be122ce00b81a89c2950c89789f8026beaae46acd457b68953');
INSERT INTO "audit" VALUES(8,1773036300000000,'person.added',1,'ana','10.0.0.9','22c9be955eb…','nov','','engineer','ok','','{"display":"nov"}','17dea8f09fdcbba0f87a08f652c679f3d7492f6ff1a441999bb558eec01f67af');
INSERT INTO "audit" VALUES(9,1773036360000000,'signin.failed',0,'system','10.0.0.8','','ivo','','','refused','access.cause.wrong','{"delay":"0"}','1edad167f8526ccdac272d00a2a02116982facbd3928e8671565f151e808a6cf');
INSERT INTO "audit" VALUES(10,1773036360000000,'signin.ok',2,'ivo','10.0.0.8','1e89d5c31a9…','ivo','','','ok','','{"agent":"Mozilla/5.0 (X11; Linux x86_64) Firefox/140.0"}','a4c26bd3fd7245e4d8db605cc13c4f1ab7017d7e7e9fe1fe25b7bc1c554ff71a');
INSERT INTO "audit" VALUES(11,1773036360000000,'token.created',1,'ana','10.0.0.9','22c9be955eb…','MES','','operate, view','ok','','{"days":"30"}','43928f238e68a5142cf1e3ab20f2ff033c197eb506bf01fa71f85290f5d23eed');
INSERT INTO "audit" VALUES(12,1773036360000000,'server.stopped',0,'system','','','','','','ok','','{}','777757fea3667c857a802010a34b1eb7d7ad3c35e5c4d23c67c28753a8a6b519');
CREATE TABLE person (
	id INTEGER NOT NULL PRIMARY KEY AUTOINCREMENT, 
	name VARCHAR(64) NOT NULL, 
	display VARCHAR(80) NOT NULL, 
	password VARCHAR(200) NOT NULL, 
	must_change BOOLEAN NOT NULL, 
	initial_until BIGINT, 
	disabled BOOLEAN NOT NULL, 
	language VARCHAR(8) NOT NULL, 
	theme VARCHAR(8) NOT NULL, 
	created BIGINT NOT NULL, 
	last_seen BIGINT, 
	CONSTRAINT uq_person_name UNIQUE (name)
);
INSERT INTO "person" VALUES(1,'ana','Ana Kos','$argon2id$v=19$m=64,t=1,p=1$Ep9p5CqliYQ5o5c1xCsPSQ$ZS8M5ntir9c5K8KuvQvSXFdlSqh989UweLelAtcLBqc',0,NULL,0,'','',1773036300000000,1773036300000000);
INSERT INTO "person" VALUES(2,'ivo','Ivo','$argon2id$v=19$m=64,t=1,p=1$vXFMK8OUenhS30YuS2gLPg$RTpDQwrzOHqfFffKnkkX93nP8/37I8reDPbb9XKAPvw',0,NULL,0,'','',1773036300000000,1773036360000000);
INSERT INTO "person" VALUES(3,'eve','eve','$argon2id$v=19$m=64,t=1,p=1$GGtvn1X2M2wzyWaxtzRx8Q$g9aot65lGsrFILBmc5WbUQNIhPfi57/ohAUOAzSUxhc',1,1773122700000000,1,'','',1773036300000000,NULL);
INSERT INTO "person" VALUES(4,'nov','nov','$argon2id$v=19$m=64,t=1,p=1$xTawyBJ8eeYlPQgSAfRZuQ$rMJO1ekvCd6Q2lu+Mq3OtEeALQcFXmxvOHU3LVsegng',1,1773122700000000,0,'','',1773036300000000,NULL);
CREATE TABLE person_role (
	person INTEGER NOT NULL, 
	role VARCHAR(16) NOT NULL, 
	CONSTRAINT pk_person_role PRIMARY KEY (person, role), 
	FOREIGN KEY(person) REFERENCES person (id) ON DELETE CASCADE
);
INSERT INTO "person_role" VALUES(1,'admin');
INSERT INTO "person_role" VALUES(1,'engineer');
INSERT INTO "person_role" VALUES(1,'operator');
INSERT INTO "person_role" VALUES(2,'operator');
INSERT INTO "person_role" VALUES(3,'viewer');
INSERT INTO "person_role" VALUES(4,'engineer');
CREATE TABLE retained (
	id VARCHAR NOT NULL, 
	state JSON NOT NULL, 
	CONSTRAINT pk_retained PRIMARY KEY (id)
);
CREATE TABLE session (
	id_hash VARCHAR(64) NOT NULL, 
	person INTEGER NOT NULL, 
	created BIGINT NOT NULL, 
	active BIGINT NOT NULL, 
	until BIGINT NOT NULL, 
	address VARCHAR(64) NOT NULL, 
	agent VARCHAR(200) NOT NULL, 
	CONSTRAINT pk_session PRIMARY KEY (id_hash), 
	FOREIGN KEY(person) REFERENCES person (id) ON DELETE CASCADE
);
INSERT INTO "session" VALUES('22c9be955eb16eecc28ec348a664d956e9a322ab5b6c9d2bd1a7d0326e5dfc06',1,1773036300000000,1773036300000000,1773065100000000,'10.0.0.9','Firefox, Linux');
INSERT INTO "session" VALUES('1e89d5c31a98bc5b2aaf09fa8b9e05cef3a8b7f2cb093dd77401d4e76664a487',2,1773036360000000,1773036360000000,1773079560000000,'10.0.0.8','Firefox, Linux');
CREATE TABLE token (
	id INTEGER NOT NULL PRIMARY KEY AUTOINCREMENT, 
	name VARCHAR(64) NOT NULL, 
	hash VARCHAR(64) NOT NULL, 
	permissions VARCHAR(200) NOT NULL, 
	person INTEGER NOT NULL, 
	created BIGINT NOT NULL, 
	until BIGINT NOT NULL, 
	last_used BIGINT, 
	revoked BOOLEAN NOT NULL, 
	FOREIGN KEY(person) REFERENCES person (id) ON DELETE CASCADE, 
	CONSTRAINT uq_token_hash UNIQUE (hash)
);
INSERT INTO "token" VALUES(1,'MES','b37b426b8519ea5eb9a0382a818bbdd73a701798d80486b00b5710d7c4e40e5a','operate view',1,1773036360000000,1775628360000000,NULL,0);
CREATE INDEX ix_session_person ON session (person);
CREATE INDEX ix_audit_time ON audit (time);
CREATE INDEX ix_audit_kind ON audit (kind);
CREATE INDEX ix_audit_person ON audit (person);
CREATE INDEX ix_audit_object ON audit (object);
CREATE INDEX ix_alarm_journal_time ON alarm_journal (time);
CREATE INDEX ix_alarm_journal_alarm ON alarm_journal (alarm, seq);
CREATE INDEX ix_alarm_journal_equipment ON alarm_journal (equipment, seq);
DELETE FROM "sqlite_sequence";
INSERT INTO "sqlite_sequence" VALUES('person',4);
INSERT INTO "sqlite_sequence" VALUES('token',1);
COMMIT;
